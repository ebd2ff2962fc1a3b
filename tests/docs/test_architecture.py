"""The picture of the house is that of the imports as they are."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REDRAW = "run: python docs/make_architecture_picture.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location(
        "make_architecture_picture", ROOT / "docs/make_architecture_picture.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def drawn():
    return json.loads((ROOT / "docs" / "architecture.json").read_text(encoding="utf-8"))


def test_what_was_drawn_is_what_is_imported(script, drawn):
    now = script.graph_of(ROOT)
    assert {one: sorted(others) for one, others in now["imports"].items()} == {
        one: sorted(others) for one, others in drawn["imports"].items()
    }, REDRAW
    for part in ("layers", "says", "holds"):
        assert now[part] == drawn[part], REDRAW


def test_arrows_are_as_wide_as_there_are_imports_give_or_take_a_few(script, drawn):
    """Not every new import asks for a new picture."""
    for one, others in script.graph_of(ROOT)["imports"].items():
        for other, count in others.items():
            assert count == pytest.approx(drawn["imports"][one][other], rel=0.3, abs=4), f"{one} -> {other}; {REDRAW}"


def test_abstractions_are_defined_where_the_page_says():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.split("## The few abstractions")[1].split("##")[0]
    rows = re.findall(r"^\| (`[^|]+`) \| (`[^|]+`) \|", table, flags=re.MULTILINE)
    assert len(rows) >= 8
    for names, places in rows:
        files = [ROOT / place for place in re.findall(r"`([^`]+)`", places)]
        sources = [each for file in files for each in (file.rglob("*.py") if file.is_dir() else [file])]
        text = "\n".join(source.read_text(encoding="utf-8") for source in sources)
        for name in re.findall(r"`([^`]+)`", names):
            assert re.search(rf"^(class|def) {name}\b", text, flags=re.MULTILINE), f"{name} is not in {places}"


def test_imports_run_downward(drawn):
    level = {name: row for row, names in enumerate(drawn["layers"]) for name in names}
    for one, others in drawn["imports"].items():
        assert all(level[other] > level[one] for other in others if one in level and other in level)


def test_what_is_left_out_of_the_picture_follows_from_what_is_drawn(script, drawn):
    arrows = script.reduced(drawn)

    def reached(name):
        return {name}.union(*(reached(other) for other in arrows[name]))

    for one, others in drawn["imports"].items():
        assert set(others) - set(script.BASEMENT) <= reached(one)
        assert set(arrows[one]) <= set(others)


def test_the_same_graph_gives_the_same_picture(script, drawn, tmp_path):
    files = [tmp_path / "one.png", tmp_path / "two.png"]
    for file in files:
        script.save(drawn, file)
    assert files[0].read_bytes() == files[1].read_bytes()
