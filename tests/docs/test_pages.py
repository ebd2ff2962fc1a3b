"""What README, CONTRIBUTING and docs/ say of files, keys and messages is so."""

import ast
import inspect
import re
from pathlib import Path
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

import pytest
import yaml
from pydantic import BaseModel

import mpc_cover
from mpc_cover.mission.config import MissionSpec
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.service.protocol import messages
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.swarm import radio_messages

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TOPS = ("mpc_cover", "solvers", "tests", "examples", "docs", "configs", ".ci")


@pytest.fixture(scope="module", params=PAGES, ids=lambda page: page.name)
def page(request):
    return request.param


def spoken_of(page):
    """Return what a page sets in backticks outside of blocks of code."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"`([^`\n]+)`", text)


def as_path(word):
    """Return the path that a word in backticks names, from the root, or None."""
    if re.fullmatch(r"(mpc_cover|solvers)(\.\w+)+", word):
        return word.replace(".", "/")
    file = "/" in word and (word.split("/")[0] in TOPS or word.endswith((".py", ".md", ".yaml")))
    return word.rstrip("/") if file and re.fullmatch(r"[\w./-]+", word) else None


def exists(path):
    """Return whether there is such a file, folder or module, or a module that has the last part as a name."""
    if any((ROOT / f"{path}{end}").exists() for end in ("", ".py")):
        return True
    owner, _, name = path.rpartition("/")
    home = ROOT / f"{owner}.py" if (ROOT / f"{owner}.py").exists() else ROOT / owner / "__init__.py"
    return home.exists() and re.search(rf"\b{name}\b", home.read_text(encoding="utf-8")) is not None


def test_a_page_names_only_files_and_modules_that_there_are(page):
    named = {path for word in spoken_of(page) if (path := as_path(word))}
    assert sorted(path for path in named if not exists(path)) == []


def test_links_of_a_page_lead_somewhere(page):
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    local = [target for target in targets if "://" not in target]
    assert [target for target in local if not (page.parent / target).exists()] == []


def test_readme_has_the_commands_that_others_extract():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for mark in ("run", "test"):
        assert len(re.findall(rf"^<!-- {mark} -->\n```\n.+\n```$", readme, flags=re.MULTILINE)) == 1


def missions_in(page):
    """Return the mission files that a page shows."""
    blocks = re.findall(r"^```yaml\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return [raw for block in blocks if "schema" in (raw := yaml.safe_load(block))]


def test_missions_that_pages_show_are_valid(page):
    for raw in missions_in(page):
        build_mission(raw, page.name)


def test_readme_shows_box_3_as_it_is():
    shown = build_mission(missions_in(ROOT / "README.md")[0], "README")
    assert shown.to_json() == load_mission("box-3").to_json()


def test_calls_that_pages_show_fit_the_functions(page):
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    calls = [node for block in blocks for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Call)]
    for call in calls:
        if ast.unparse(call.func).startswith("mpc_cover."):
            function = getattr(mpc_cover, call.func.attr)
            inspect.signature(function).bind(*call.args, **{each.arg: each.value for each in call.keywords})


def models_in(annotation):
    """Yield the models that a field may hold, each with whether it holds several."""
    if get_origin(annotation) is Annotated:
        yield from models_in(get_args(annotation)[0])
    elif get_origin(annotation) in (UnionType, Union, tuple):
        several = get_origin(annotation) is tuple
        for part in get_args(annotation):
            yield from ((model, several or more) for model, more in models_in(part))
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, False


def keys_of(model, prefix=""):
    """Yield each key of a mission with its default: "required", None where it may be left out, or a value."""
    for name, field in model.model_fields.items():
        path = f"{prefix}{field.alias or name}"
        inner = list(models_in(field.annotation))
        for other, several in inner:
            yield from keys_of(other, f"{path}{'[]' if several else ''}.")
        if not inner:
            plain = isinstance(field.default, bool | int | float | str)
            yield path, "required" if field.is_required() else field.default if plain else None


def test_the_page_of_missions_has_every_key_with_its_default_and_no_other():
    text = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"^\| `([^`]+)` \| ([^|]+) \|", text, flags=re.MULTILINE))
    expected = {path: "-" if default is None else str(default) for path, default in keys_of(MissionSpec)}
    expected["magnitudes"] = "-"
    assert shown == expected


def test_the_page_of_the_protocol_has_every_key_and_every_message():
    text = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    keys, agent = Keys("<mission>"), "<id>"
    spoken = [keys.state, keys.plan, keys.agent_event, keys.hello, keys.word]
    shown = [key(agent) for key in spoken] + [keys.agent_alive(agent, "<instance>")]
    shown += [keys.status, keys.map, keys.controller_event, keys.controller_alive]
    assert [key for key in shown if f"`{key}`" not in text] == []
    kinds = [kind for module in (messages, radio_messages) for kind in vars(module).values() if isinstance(kind, type)]
    sent = {kind.__name__ for kind in kinds if issubclass(kind, messages.Message) and kind is not messages.Message}
    assert {name for name in sent if f"`{name}`" not in text} == set()
