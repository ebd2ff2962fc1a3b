"""Where commands write: a free name, or what is asked for if nothing is lost by it."""

import pytest

from mpc_cover.errors import UserError
from mpc_cover.output import any_of, check_folder, file_taken, free_path, output_path


@pytest.mark.parametrize(
    ("there", "name", "free"),
    [
        ((), "plan.npz", "plan.npz"),
        (("plan.npz",), "plan.npz", "plan-2.npz"),
        (("plan.npz", "plan-2.npz", "plan-4.npz"), "plan.npz", "plan-3.npz"),
        (("runs-v1.5",), "runs-v1.5", "runs-v1.5-2"),
    ],
)
def test_a_default_is_a_name_that_is_free(tmp_path, there, name, free):
    for each in there:
        (tmp_path / each).touch()
    assert free_path(tmp_path / name) == tmp_path / free
    assert output_path(None, tmp_path / name, file_taken) == tmp_path / free


def test_what_would_be_lost_is_named_and_can_be_given_up(tmp_path):
    taken = any_of("bench.json", "bench-*.png")
    assert output_path(tmp_path, tmp_path, taken) == tmp_path
    (tmp_path / "other.txt").touch()
    assert output_path(tmp_path, tmp_path, taken) == tmp_path
    (tmp_path / "bench-rest.png").touch()
    with pytest.raises(UserError, match=r"--out .*: .*bench-rest\.png is there already: give another --out, or --over"):
        output_path(tmp_path, tmp_path, taken)
    assert output_path(tmp_path, tmp_path, taken, overwrite=True) == tmp_path


def test_a_name_that_is_none_is_told_in_words(tmp_path):
    odd = tmp_path / "a\0b"
    assert output_path(odd, odd, file_taken) == odd
    with pytest.raises(UserError, match="cannot be written"):
        check_folder(odd)


def test_a_folder_is_tried_before_the_work_and_left_empty(tmp_path):
    check_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="cannot be written"):
        check_folder(tmp_path / "file")
