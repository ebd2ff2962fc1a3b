"""`mpc-cover size`: the number of agents for a rate of measurement."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from mpc_cover.cli.options import Json, Overwrite, console_for, print_json
from mpc_cover.output import any_of, check_folder, output_path


def size(
    area: Annotated[float, typer.Option("--area", help="Area to be measured [m^2].")] = 100.0,
    radius: Annotated[float, typer.Option("--radius", help="Sensing radius [m].")] = 1.0,
    speed: Annotated[float, typer.Option("--speed", help="Speed of an agent [m/s].")] = 1.5,
    cover: Annotated[
        float, typer.Option("--cover", help="Part of the area that a round covers, between 0 and 1.")
    ] = 0.95,
    rate: Annotated[float | None, typer.Option("--rate", help="Rounds a second [Hz]: how many agents is that?")] = None,
    agents: Annotated[
        str, typer.Option("--agents", metavar="N,...", help="What rate do so many agents give? Simulated, too.")
    ] = "5,10,15",
    seeds: Annotated[
        int, typer.Option("--seeds", min=0, max=10_000, help="Random starts for the potential law; 0: the model alone.")
    ] = 10,
    horizon_seeds: Annotated[
        int, typer.Option("--mpc-seeds", min=0, max=1000, help="Random starts for the receding horizon: minutes each.")
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="The first seed.")] = 0,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for figures 1.1 and 1.2.")] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """How many agents for a wanted rate of measurement, what rate for a number, and how far the model is off."""
    from mpc_cover.studies.sizing_study import (  # noqa: PLC0415 - --help need not wait for these
        SizingOptions,
        draw_sizing,
        parse_numbers,
        sizing_problem,
    )
    from mpc_cover.studies.sizing_study import size as answer_of  # noqa: PLC0415
    from mpc_cover.view.progress import ProgressLine  # noqa: PLC0415

    console = console_for(as_json=as_json)

    def show(text: str) -> None:
        console.print(text, highlight=False, markup=False, soft_wrap=not console.is_terminal)

    problem = sizing_problem(area, radius, speed, cover)
    options = SizingOptions(rate, parse_numbers(agents), seeds, horizon_seeds, seed)
    if out is not None:
        check_folder(output_path(out, out, any_of("size.json", "figure-1.[12]*.png"), overwrite=overwrite))
    with ProgressLine() as line:
        answer = answer_of(problem, options, line.begin)
    show(answer.text)
    for file in draw_sizing(answer, out) if out is not None else []:
        show(f"written to {file}")
    if as_json:
        print_json(answer.to_dict())
