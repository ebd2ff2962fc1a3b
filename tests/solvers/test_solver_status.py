"""Every native status is mapped, and every status has a sentence."""

from __future__ import annotations

import clarabel
import osqp
import piqp
import pytest

from solvers.backends import clarabel_, osqp_, piqp_
from solvers.outcome import Outcome
from solvers.status import Status


@pytest.mark.parametrize("kind", [Status, Outcome])
def test_every_member_has_a_sentence_of_its_own(kind: type[Status | Outcome]) -> None:
    sentences = [member.sentence for member in kind]
    assert len(set(sentences)) == len(sentences)
    assert all(sentence[0].isupper() and sentence.endswith(".") for sentence in sentences)


def test_only_solved_is_ok() -> None:
    assert [status for status in Status if status.ok] == [Status.SOLVED]


def test_osqp_statuses_are_all_mapped() -> None:
    natives = {member.name for member in osqp.SolverStatus}
    assert natives == set(osqp_.STATUS)
    assert set(osqp_.NAMES.values()) == natives


def test_clarabel_statuses_are_all_mapped() -> None:
    natives = {name for name in dir(clarabel.SolverStatus) if not name.startswith("_")}
    assert natives == set(clarabel_.STATUS)
    assert all(str(getattr(clarabel.SolverStatus, name)) == name for name in natives)


def test_piqp_statuses_are_all_mapped() -> None:
    assert set(piqp.Status.__members__) == set(piqp_.STATUS)


@pytest.mark.parametrize("table", [osqp_.STATUS, clarabel_.STATUS, piqp_.STATUS])
def test_exactly_one_native_status_means_solved(table: dict[str, Status]) -> None:
    assert list(table.values()).count(Status.SOLVED) == 1
