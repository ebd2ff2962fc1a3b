"""Checkpoints of a mission's progress: incomplete, damaged or forged ones are detected, and the one before is used."""

from __future__ import annotations

import hashlib
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import mission_from_json
from mpc_cover.service.controller.checkpoint_format import DAMAGED, flaw_of, pack, unpack
from mpc_cover.service.controller.retask import carry_over, retask_problems
from mpc_cover.service.controller.state_directory import write_durably
from mpc_cover.service.protocol.fingerprint import mission_hash

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.snapshot import Snapshot
    from mpc_cover.service.controller.state_directory import StateDirectory

GENERATIONS = 2
PERIOD_S = 1.0
"""How often a checkpoint is written [s of the machine's clock]."""


class FileCheckpoints:
    """Keeps checkpoints in a state directory, alternately in two files."""

    def __init__(
        self, folder: StateDirectory, mission: Mission, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._folder = folder
        self._mission = mission_hash(mission)
        self._given = mission
        self._monotonic = monotonic
        self._due_s = -np.inf
        self._written = ""
        self._versions: list[str] = []
        self._secret, self._refused = folder.secret(), list[str]()
        self._kept = self._read()
        self._generation = max((generation for _, generation, _ in self._kept), default=0)

    @property
    def epoch(self) -> int:
        """The highest epoch of a controller that wrote one of the checkpoints; 0 without any."""
        return max((snapshot.epoch for _, _, snapshot in self._kept), default=0)

    def load(self) -> tuple[Snapshot | None, str]:
        """Return the snapshot to resume from, if any, and a message for the user."""
        snapshot, text = self._load()
        refused = [f"checkpoint {flaw}: it is not used" for flaw in self._refused]
        return snapshot, "; ".join([*refused, *([text] if text else [])])

    def _load(self) -> tuple[Snapshot | None, str]:
        newest = self._newest
        if newest is None:
            there = any(path.exists() for path in self._paths())
            return None, "no checkpoint is readable: starts afresh" if there else ""
        mission, _, snapshot = newest
        if mission != self._mission:
            return self._of_another_version(mission, snapshot)
        if not self._fits(snapshot):
            return None, "the checkpoint does not fit this mission: starts afresh"
        if snapshot.finished:
            return None, "the mission was finished: starts afresh"
        return snapshot, f"goes on from the checkpoint at mission time {snapshot.mission_time_s:.1f} s"

    @property
    def versions(self) -> list[str]:
        """Fingerprints of earlier versions of the mission for the same fleet, whether it is resumed or not."""
        newest = self._newest
        if newest is None:
            return []
        return newest[2].versions if newest[0] == self._mission else self._versions

    def set_mission(self, mission: Mission) -> None:
        """Keep snapshots of another version of the mission from now on."""
        self._mission, self._given = mission_hash(mission), mission

    def _of_another_version(self, fingerprint: str, snapshot: Snapshot) -> tuple[Snapshot | None, str]:
        """Return what still holds of a checkpoint of another version of the mission, as a retask would keep it."""
        other = "the checkpoint is of another version of this mission"
        try:
            data = self._mission_file(fingerprint).read_bytes()
            if hashlib.sha256(data).hexdigest() != fingerprint:  # for which the checkpoint's MAC vouches
                return None, f"{other}, whose file is damaged: starts afresh"
            old = mission_from_json(data.decode("utf-8"), "the mission")
        except (OSError, UserError):
            return None, f"{other}, which is not kept: starts afresh"
        if (why := self._differs(old, snapshot.mission_time_s)) is not None:
            return None, f"{other}, whose map cannot be carried over: starts afresh ({why})"
        try:
            known = carry_over(old, snapshot.map, self._given, snapshot.mission_time_s)
            coverage = make_map(self._given)
            coverage.restore(known)
        except (ValueError, KeyError, IndexError):
            return None, f"{other}, whose map does not fit it: starts afresh"
        for_agents = any(retask_problems(old, self._given, snapshot.mission_time_s))
        self._versions = [] if for_agents else [*dict.fromkeys([*snapshot.versions, fingerprint])]
        kept = f"{coverage.covered_count} of {coverage.cell_count} cells are covered already"
        text = f"{other}: goes on at mission time {snapshot.mission_time_s:.1f} s with what still holds of it, {kept}"
        return replace(snapshot, map=known, finished=False, versions=self._versions), text

    def _differs(self, old: Mission, time_s: float) -> str | None:
        """Return why what was measured for an old version of the mission says nothing of this one; None if it does."""
        if old.spec.magnitudes != self._given.spec.magnitudes:
            return f"magnitudes: {list(old.spec.magnitudes)} there"
        if old.fleet.dimension != self._given.fleet.dimension:
            return f"{old.fleet.dimension} dimensions there"
        limit_s = self._given.spec.control.time_limit_s
        return f"control.time_limit_s {limit_s:g} is over" if limit_s <= time_s else None

    def _mission_file(self, fingerprint: str) -> Path:
        return self._folder.path / f"mission.{fingerprint[:16]}.json"

    def _keep_mission(self) -> None:
        """Write the present version of the mission, for a later one to take over; remove all but the newest few."""
        file = self._mission_file(self._mission)
        if self._written == self._mission:
            return
        write_durably(file, self._given.to_json().encode())
        self._written = self._mission
        others = sorted(self._folder.path.glob("mission.*.json"), key=lambda path: path.stat().st_mtime)
        for old in [path for path in others if path != file][:-GENERATIONS]:
            old.unlink(missing_ok=True)

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:
        """Write a checkpoint, at most one per second unless `now`; return an error message, if any."""
        time_s = self._monotonic()
        if not now and time_s < self._due_s:
            return None
        self._due_s = time_s + PERIOD_S
        generation = self._generation + 1
        try:
            self._keep_mission()
            data = pack(snapshot, self._mission, generation, self._secret)
            write_durably(self._paths()[generation % GENERATIONS], data)
        except OSError as error:
            return f"the checkpoint cannot be written: {error.strerror}; control goes on"
        self._generation = generation
        return None

    def close(self) -> None:
        """Unlock the folder."""
        self._folder.close()

    @property
    def _newest(self) -> tuple[str, int, Snapshot] | None:
        return max(self._kept, key=lambda kept: kept[1], default=None)

    def _fits(self, snapshot: Snapshot) -> bool:
        try:
            make_map(self._given).restore(snapshot.map)
        except ValueError:
            return False
        return True

    def _paths(self) -> list[Path]:
        return [self._folder.path / f"coverage.{index}" for index in range(GENERATIONS)]

    def _read(self) -> list[tuple[str, int, Snapshot]]:
        kept = []
        for path in self._paths():
            try:
                data = path.read_bytes()
            except OSError:
                continue
            if (unpacked := unpack(data, self._secret)) is not None:
                kept.append(unpacked)
            elif (flaw := flaw_of(data, self._secret)) and flaw != DAMAGED:
                self._refused.append(f"{path} {flaw}")
        return kept
