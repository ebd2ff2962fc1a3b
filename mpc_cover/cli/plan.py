"""`mpc-cover plan`: the optimal coverage NLP offline."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mpc_cover.cli.options import (
    DEFAULT_BACKEND,
    ExtraOption,
    Json,
    Overwrite,
    Seed,
    check_backend,
    check_seconds,
    console_for,
    finish,
    load_extra_option,
    print_json,
)
from mpc_cover.errors import UserError
from mpc_cover.exit_status import exit_status


class Cones(StrEnum):
    """How discs of speeds, inputs and edges are constrained."""

    POLYGONS = "polygons"
    EXACT = "exact"


def plan(
    mission: Annotated[
        str | None,
        typer.Argument(
            metavar="[MISSION]", help="A mission file (YAML), or the name of one that comes along; default box-3."
        ),
    ] = None,
    everything: Annotated[
        Path | None, typer.Option("--all", metavar="DIR", help="Plan every mission of a folder instead.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Trajectory file, or with --all the folder; default plan.npz, plan-2.npz, ...; plans."
        ),
    ] = None,
    overwrite: Overwrite = False,
    starts: Annotated[int, typer.Option("--starts", min=1, max=1000, help="Guesses to tell apart.")] = 10,
    time_limit: Annotated[
        float | None, typer.Option("--time-limit", help="Seconds to search; whatever the limit, the result holds.")
    ] = None,
    min_time: Annotated[
        bool, typer.Option("--min-time", help="Search for the shortest plan that covers everything.")
    ] = False,
    cones: Annotated[
        str,
        typer.Option("--cones", help="Speeds, inputs, edges as polygons inside their discs, or exact, by cones."),
    ] = Cones.POLYGONS.value,
    profile: Annotated[bool, typer.Option("--profile", help="Show where the time goes.")] = False,
    formulation: Annotated[
        str,
        typer.Option("--formulation", help="Subproblems assembled as QPs, or in CVXPY: qp or cvxpy."),
    ] = "qp",
    extra: ExtraOption = None,
    seed: Seed = 0,
    backend: Annotated[
        str | None,
        typer.Option(
            "--backend",
            metavar="NAME",
            help="native (the default), piqp, clarabel or osqp; of cvxpy any solver that it has, by default clarabel.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Solve the optimal coverage NLP offline, over the mission's planning.duration_s, or as long as it takes.

    With --formulation cvxpy, a function of yours (--extra) may add convex terms to J, and constraints.

    Ctrl-C ends the search: the best plan found until then is written, and the exit status is 130.
    """
    from mpc_cover.planning.cvxpy_extra.solver_names import DEFAULT_SOLVER  # noqa: PLC0415
    from mpc_cover.planning.offline import Formulation, PlanOptions  # noqa: PLC0415 - --help needs none of these
    from mpc_cover.studies.plans import plan_files, plan_targets  # noqa: PLC0415

    with_cvxpy = formulation == Formulation.CVXPY
    if not with_cvxpy:
        check_backend(backend or DEFAULT_BACKEND)
    backend = backend or (DEFAULT_SOLVER if with_cvxpy else DEFAULT_BACKEND)
    if time_limit is not None:
        check_seconds("--time-limit", time_limit)
    if extra is not None and not with_cvxpy:
        raise UserError(f"--extra {extra}: is part of CVXPY's subproblems: needs --formulation cvxpy")
    if mission is not None and everything is not None:
        raise UserError(f"MISSION {mission} and --all {everything} are both given: plan one mission, or a folder")
    if cones not in set(Cones):
        raise UserError(f"--cones {cones}: must be polygons or exact")
    options = PlanOptions(
        backend,
        seed,
        starts,
        time_limit,
        min_time,
        cones == Cones.EXACT,
        keep_on_interrupt=True,
        formulation=formulation,
        extra=load_extra_option(extra) if with_cvxpy else None,
    )
    console, several = console_for(as_json=as_json), everything is not None
    try:
        files = plan_targets(everything or mission or "box-3", out, folder=several, overwrite=overwrite)
        results = plan_files(files, options, console, profile=profile)
    except KeyboardInterrupt:
        sys.stderr.write("mpc-cover: interrupted before any plan was found: nothing is written\n")
        raise typer.Exit(exit_status(interrupted=True)) from None
    for summary, facts in results:
        where = Path(facts["file"]) if facts["file"] is not None else None
        finish(console, summary, facts, as_json=as_json and not several, where=where)
    if as_json and several:
        print_json({"plans": [{**summary.to_dict(), **facts} for summary, facts in results]})
    holds = all(summary.holds for summary, _ in results)
    covered = all(summary.covered_cells == summary.cells for summary, _ in results)
    interrupted = any(facts["interrupted"] for _, facts in results)
    raise typer.Exit(exit_status(holds=holds, covered=covered, interrupted=interrupted))
