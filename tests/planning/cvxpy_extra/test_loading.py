"""The function that `--extra` names, from the current folder."""

import sys

import pytest

import mpc_cover
from mpc_cover.planning.cvxpy_extra.loading import extra_of, load_extra


@pytest.fixture
def module(tmp_path, monkeypatch, request):
    """Return a function that writes a module into the current folder, with a name of the test's own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])

    def module(text):
        name = f"wishes_{abs(hash(request.node.name))}"
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
        return name

    return module


def said(name):
    with pytest.raises(mpc_cover.UserError) as raised:
        load_extra(name)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_a_module_beside_which_one_stands_is_found_and_so_is_what_it_imports_later(module, tmp_path):
    name = module("def wish(motion, mission):\n    import beside_it\n    return beside_it.TERMS, []\n")
    (tmp_path / "beside_it.py").write_text("TERMS = [1.0]\n", encoding="utf-8")
    extra = load_extra(f"{name}:wish")
    assert extra.name == f"{name}:wish"
    assert [float(term.value) for term in extra.parts(None, None).terms] == [1.0]


def test_there_is_no_such_module(module, tmp_path):
    module("")
    assert f"there is no module nowhere_to_be_found, neither in {tmp_path}" in said("nowhere_to_be_found:wish")
    assert "there is no module nowhere_to_be_found" in said("nowhere_to_be_found.deeper:wish")


@pytest.mark.parametrize("text", ["wish", "wish.py:keep", ":wish", "wish:", "my-module:wish", "a:b:c"])
def test_a_name_of_another_form(text):
    assert "must be module:function" in said(text)


def test_the_form_of_a_file_is_told_how_to_be_one():
    assert said("folder/wish.py:keep").endswith("as in wish:keep")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import nothing_like_it\n", "ModuleNotFoundError: No module named 'nothing_like_it'"),
        ("\n\nx = 1 / 0\n", "ZeroDivisionError: division by zero"),
        ("\n\ndef wish(:\n", "SyntaxError: "),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_with_its_line(module, text, words):
    name = module(text)
    message = said(f"{name}:wish")
    assert f"{name} cannot be imported: {words}" in message
    assert message.endswith(f"({name}.py, line {3 if text.startswith(chr(10)) else 1})")


def test_there_is_no_such_function(module):
    name = module("def wish(motion, mission):\n    return [], []\n\nWISHES = 3\n")
    assert said(f"{name}:whish").endswith(f"module {name} has no whish; it has wish")
    assert "WISHES is int: must be a function" in said(f"{name}:WISHES")


def test_functions_have_names_too():
    def wish(motion, mission):
        return [], []

    assert extra_of(wish).name == f"{__name__}:wish"
    assert extra_of(None) is None
    with pytest.raises(mpc_cover.UserError, match="must be a function, or its name"):
        extra_of(3.0)
