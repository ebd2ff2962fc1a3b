"""`mpc-cover study thesis`: reproduces all figures of the thesis, and counts how often the law covers everything.

Each part is made atomically in a folder of its own; parts that exist already, of the same mission, seed and version,
are not made again.
"""

from __future__ import annotations

import hashlib
import shutil
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import msgspec

from mpc_cover.errors import UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.output import output_path
from mpc_cover.studies.progress import CountedProgress
from mpc_cover.studies.thesis_page import thesis_page
from mpc_cover.studies.thesis_parts import Part, PartResult, all_parts
from mpc_cover.studies.thesis_seeds import SeedTally, run_seeds, tally
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from rich.console import Console

_FILE = "part.json"


@dataclass(frozen=True)
class ThesisOptions:
    """See `mpc-cover study thesis --help`."""

    seed: int = 1
    seeds: int = 0
    only: tuple[str, ...] = ()
    jobs: int = 1
    overwrite: bool = False


@dataclass(frozen=True)
class ThesisResult:
    """The page, the parts drawn, problems found, and the tallies of seeds."""

    page: Path
    parts: list[PartResult]
    problems: list[str]
    tallies: list[SeedTally]

    @property
    def exit_status(self) -> int:
        """1 when there are problems."""
        return 1 if self.problems else 0

    def to_dict(self) -> dict[str, Any]:
        """Return it for `--json`."""
        figures = {panel.number: panel.facts for part in self.parts for panel in part.panels if panel.facts}
        seeds = [tallied.to_dict() for tallied in self.tallies]
        return {"page": str(self.page), "figures": figures, "seeds": seeds, "problems": self.problems}


def run_thesis(out: Path, options: ThesisOptions, console: Console, command: str) -> ThesisResult:
    """Draw the figures, fly the seeds, and write the page.

    Raises
    ------
    UserError
        There is no such figure, or the folder cannot be written.
    """
    parts = chosen_parts(options.only)
    output_path(out, out, partial(_foreign, parts=parts, seed=options.seed), overwrite=options.overwrite)
    try:
        (out / "parts").mkdir(parents=True, exist_ok=True)
        results = _drawn(out / "parts", parts, options, console)
        tallies = _tallied(out / "seeds", parts, options, console)
        problems = [problem for result in results for problem in result.problems]
        problems += [problem for tallied in tallies for problem in tallied.problems]
        page = out / "index.html"
        unfinished = page.with_suffix(".part")
        unfinished.write_text(thesis_page(out / "parts", results, tallies, command), encoding="utf-8")
        unfinished.replace(page)
    except OSError as error:
        raise UserError(f"--out {out}: cannot be written: {error.strerror or error}") from None
    return ThesisResult(page, results, problems, tallies)


def chosen_parts(only: Sequence[str]) -> list[Part]:
    """Return the parts selected by figure or mission; all if none is.

    Raises
    ------
    UserError
        There is no such figure.
    """
    parts = all_parts()
    known = [name for part in parts for name in part.names()]
    if unknown := [name for name in only if name not in known]:
        raise UserError(f"--only {', '.join(unknown)}: is no figure of ours: must be among {', '.join(known)}")
    return [part for part in parts if not only or set(part.names()) & set(only)]


def _drawn(folder: Path, parts: list[Part], options: ThesisOptions, console: Console) -> list[PartResult]:
    """Return all parts, in order, those that are missing made now."""
    ready = {part.key: found for part in parts if (found := _finished(folder, part, options.seed)) is not None}
    todo = [part for part in parts if part.key not in ready]
    if ready:
        console.print(f"{len(ready)} of {len(parts)} parts are there already", highlight=False)
    with CountedProgress(len(todo), "parts") as progress:
        for result in _made(folder, todo, options):
            ready[result.key] = result
            facts = [fact for panel in result.panels for fact in panel.facts]
            progress.say(f"{len(ready)} of {len(parts)}  {result.key}: {'; '.join(facts)}")
            progress.show(result.key)
    return [ready[part.key] for part in parts]


def _made(folder: Path, todo: list[Part], options: ThesisOptions) -> Iterator[PartResult]:
    tasks = [(part, folder, options.seed) for part in todo]
    yield from in_parallel(_make, tasks, options.jobs)


def in_parallel(function: Any, tasks: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[Any]:
    """Yield the results of `function` on each task, as completed, from `jobs` processes with one thread each."""
    if min(jobs, len(tasks)) <= 1:
        for task in tasks:
            yield function(*task)
        return
    import joblib  # noqa: PLC0415 - only here
    from joblib.externals.loky.process_executor import TerminatedWorkerError  # noqa: PLC0415 - likewise

    with joblib.parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
        parallel = joblib.Parallel(return_as="generator_unordered", batch_size=1)
    try:
        with closing(parallel(joblib.delayed(function)(*task) for task in tasks)) as results:
            yield from results
    except TerminatedWorkerError:
        raise UserError("a process of the study was killed: what is finished is kept; fewer --jobs need less") from None


def _make(part: Part, folder: Path, seed: int) -> PartResult:
    """Make a part in a temporary folder, and move it into place."""
    unfinished, place = folder / f".{part.key}.part", folder / part.key
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir()
    try:
        made = msgspec.structs.replace(part.make(part, unfinished, seed), stamp=_stamp(part, seed))
        (unfinished / _FILE).write_bytes(msgspec.json.encode(made))
        shutil.rmtree(place, ignore_errors=True)
        unfinished.replace(place)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return made


def _finished(folder: Path, part: Part, seed: int) -> PartResult | None:
    """Return a part that was made earlier with the same stamp, or None."""
    place = folder / part.key
    try:
        found = msgspec.json.decode((place / _FILE).read_bytes(), type=PartResult)
    except (OSError, msgspec.MsgspecError):
        return None
    whole = all((place / panel.file).is_file() for panel in found.panels)
    return found if whole and found.stamp == _stamp(part, seed) else None


def _foreign(out: Path, parts: Sequence[Part], seed: int) -> Path | None:
    """Return what a folder holds that would be lost: a page of something else, or a part of another seed or version."""
    page = out / "index.html"
    if page.is_file() and not (out / "parts").is_dir():
        return page
    for part in parts:
        file = out / "parts" / part.key / _FILE
        try:
            found = msgspec.json.decode(file.read_bytes(), type=PartResult)
        except (OSError, msgspec.MsgspecError):
            continue
        if found.stamp != _stamp(part, seed):
            return file
    return None


def _stamp(part: Part, seed: int) -> str:
    """Return a hash of everything that determines a part."""
    mission = "" if part.mission is None else load_mission(str(part.mission)).to_json()
    return hashlib.sha256(f"{__version__} {part.key} {seed} {mission}".encode()).hexdigest()


def _tallied(folder: Path, parts: list[Part], options: ThesisOptions, console: Console) -> list[SeedTally]:
    """Fly the seeds that are missing, and count."""
    flown = [part for part in parts if part.chapter >= 5 and part.mission is not None]  # noqa: PLR2004 - 5 and 6
    if options.seeds == 0 or not flown:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    run_seeds(folder, flown, options.seeds, lambda tasks, fly: in_parallel(fly, tasks, options.jobs))
    tallies = [tally(folder, part, options.seeds) for part in flown]
    for tallied in tallies:
        console.print(tallied.text, highlight=False, markup=False, soft_wrap=True)
    return tallies
