"""The documentation: its blocks run, its site builds and loads nothing from outside."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import gaia_uwb
import page_blocks
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.logs.input_description import InputDescription
from page_blocks import Block, PageError, Runner, agrees, parse, run_page

ROOT = Path(__file__).parents[1]
# Written by the commands that they name, which take minutes to hours.
WRITTEN_BY_COMMANDS = {"results.md", "simulator-check.md"}
PAGES = sorted(
    path
    for path in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    if path.name not in WRITTEN_BY_COMMANDS
)
# What a reader of the page already has, where the page itself does not say so to the runner.
BEFORE = {"README.md": "<!-- run first: gaia simulate --format csv --out my-log -->\n"}


def text_of(path: Path) -> str:
    return BEFORE.get(path.name, "") + path.read_text(encoding="utf-8")


def runs_something(path: Path) -> bool:
    blocks = parse(text_of(path))
    return any(block.kind == "run" for block in blocks[len(BEFORE.get(path.name, "")) > 0 :])


def left_out() -> list[tuple[Path, Block]]:
    found = [(path, block) for path in PAGES for block in parse(text_of(path))]
    return [(path, block) for path, block in found if block.kind == "left out"]


def name_of(value: object) -> str:
    return str(value.relative_to(ROOT)) if isinstance(value, Path) else ""


@pytest.mark.parametrize("path", [p for p in PAGES if runs_something(p)], ids=name_of)
def test_the_blocks_of_a_page_run_and_print_what_it_shows(path: Path, tmp_path: Path) -> None:
    for block, printed in run_page(text_of(path), Runner(tmp_path, path.name)):
        assert agrees(block.text, printed), (
            f"{path}, line {block.line}: run tools/page_blocks.py --update; printed\n{printed}"
        )


@pytest.mark.parametrize(
    ("path", "block"),
    left_out(),
    ids=[f"{path.relative_to(ROOT)}:{block.line}" for path, block in left_out()],
)
def test_blocks_that_do_not_run_say_why(path: Path, block: Block) -> None:
    assert len(block.note) > 5, f"{path}, line {block.line}: say why this block does not run"
    pytest.skip(f"left out: {path.name}, line {block.line}: {block.note}")


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_commands_stand_in_blocks_that_run(path: Path) -> None:
    if path.name == "README.md":
        return
    for block in parse(text_of(path)):
        if block.kind == "shown":
            commands = re.findall(r"^(?:gaia|pip|python|git|make) .*", block.text, re.MULTILINE)
            assert not commands, f"{path}, line {block.line}: mark this block as bash"


def test_the_descriptions_on_the_page_of_inputs_are_valid() -> None:
    page = (ROOT / "docs" / "inputs.md").read_text(encoding="utf-8")
    base = {
        "trajectory": {"file": "drive.nmea", "format": "nmea"},
        "ranges": [{"file": "tag.log", "format": "dwm1001"}],
    }
    found = [yaml.safe_load(block.text) for block in parse(page) if block.language == "yaml"]
    assert len(found) >= 4
    for description in found:
        InputDescription.model_validate(base | description)


def test_the_page_on_unreliable_results_quotes_the_program() -> None:
    page = (ROOT / "docs" / "howto" / "unreliable.md").read_text(encoding="utf-8")
    table = page[page.index("| it says |") :].partition("\n\n")[0].splitlines()[2:]
    said = [line.split(" | ")[0].removeprefix("| ") for line in table]
    source = "".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "src" / "gaia_uwb").rglob("*.py")
    )
    assert len(said) > 8
    assert [text for text in said if text not in source] == []


def test_a_page_runs_as_one(tmp_path: Path) -> None:
    page = "\n".join(
        [
            "<!-- run first: echo ready > state -->",
            '```yaml title="deep/file.yaml"',
            "a: 1",
            "```",
            "```bash",
            "cat state deep/file.yaml",
            "```",
            "<!-- output -->",
            "```text",
            "ready",
            "...",
            "```",
            "```python",
            "from pathlib import Path",
            "number = 41",
            "```",
            "<!-- not run: needs another number -->",
            "```python",
            "number = 1",
            "```",
            "```python",
            'print(number + 1, Path("state").read_text())',
            "```",
            "<!-- output -->",
            "```text",
            "43",
            "```",
        ]
    )
    first, second = run_page(page, Runner(tmp_path))
    assert agrees(first[0].text, first[1])
    assert second[1] == "42 ready\n\n"
    assert not agrees(second[0].text, second[1])


def test_a_block_must_end_as_it_says(tmp_path: Path) -> None:
    assert list(run_page("<!-- exit 3 -->\n```bash\nexit 3\n```", Runner(tmp_path))) == []
    with pytest.raises(PageError, match=r"line 1: exit code 1, expected 0\nfalse; echo on"):
        list(run_page("```bash\nfalse; echo on\n```", Runner(tmp_path)))
    with pytest.raises(ZeroDivisionError):
        list(run_page("```python\n1 / 0\n```", Runner(tmp_path)))


@pytest.mark.parametrize(
    ("page", "problem"),
    [
        ("```bash\nls", "line 1: this fence is not closed"),
        ("- list\n  ```bash\n  ls\n  ```", "line 2: expected a fence at the margin"),
        ("<!-- output -->\n```text\nx\n```", "line 2: an output block without a block before it"),
        ("<!-- not run: x -->\n\nwords", "line 3: expected a block after a comment"),
    ],
)
def test_pages_that_cannot_be_understood(page: str, problem: str) -> None:
    with pytest.raises(PageError, match=re.escape(problem)):
        parse(page)


def test_updates_outputs_that_changed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```bash\nseq 3\n```\n\n<!-- output -->\n```text\nold\n```\n\n"
        "```bash\necho 4\n```\n\n<!-- output -->\n```text\n...\n```\nend\n"
    )
    assert page_blocks.update_page(page)
    assert "```text\n1\n2\n3\n```" in page.read_text()
    assert page.read_text().endswith("```text\n4\n```\nend\n")
    assert not page_blocks.update_page(page)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir"]
    done = subprocess.run(
        [*command, str(folder)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_site_loads_nothing_from_outside(site: Path) -> None:
    loads = re.compile(
        r"<(?:script|img|iframe|source|video|audio|embed|object)\b[^>]*?"
        r"\b(?:src|data|srcset)=[\"']?((?:https?:)?//[^\"'> ]+)"
        r"|<link\b(?![^>]*rel=[\"']?canonical)[^>]*?href=[\"']?((?:https?:)?//[^\"'> ]+)"
        r"|(?:url\(|@import )[\"']?((?:https?:)?//[^\"') ]+)"
    )
    pages = [path for kind in ("*.html", "*.css") for path in site.rglob(kind)]
    assert len(pages) > 20
    for path in pages:
        assert loads.findall(path.read_text(encoding="utf-8")) == [], path


def test_the_site_searches_without_a_server(site: Path) -> None:
    assert (site / "search" / "search_index.js").stat().st_size > 10_000
    page = (site / "index.html").read_text(encoding="utf-8")
    assert "iframe-worker.js" in page
    assert (site / "assets" / "javascripts" / "iframe-worker.js").is_file()


def test_the_reference_has_every_public_name(site: Path) -> None:
    page = (site / "reference" / "python.html").read_text(encoding="utf-8")
    shown = {name.rpartition(".")[2] for name in re.findall(r'id="(gaia_uwb\.[\w.]+)"', page)}
    assert set(gaia_uwb.__all__) - shown == set()
    assert not re.search(r":(?:func|class|data|attr):", page)
    assert '<a class="autorefs autorefs-internal"' in page


def test_the_generated_pages_know_commands_and_settings(site: Path) -> None:
    commands = (site / "reference" / "command-line.html").read_text(encoding="utf-8")
    for command in ("reconstruct", "data check", "wzdx validate", "simulate"):
        assert f"<code>gaia {command}</code>" in commands
    settings = (site / "reference" / "settings.html").read_text(encoding="utf-8")
    for name in ("alignment.max_gap_s", "lever_arm.up_m", "verified_below_m", "ranging.sigma_m"):
        assert f"<code>{name}</code>" in settings


SCRIPT = re.compile(r"\b(?:benchmarks|tests/endurance|tools)/[\w/]*\.py\b")


def test_scripts_that_are_named_are_there() -> None:
    names = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "Makefile", "benchmarks/README.md")
    folders = (("docs", "*.md"), ("src", "*.py"), ("tests", "*.py"), ("benchmarks", "*.py"))
    files = [ROOT / name for name in names]
    files += [path for folder, kind in folders for path in (ROOT / folder).rglob(kind)]
    named = {
        (str(path.relative_to(ROOT)), script)
        for path in files
        for script in SCRIPT.findall(path.read_text(encoding="utf-8"))
    }
    assert len(named) > 20
    assert [pair for pair in sorted(named) if not (ROOT / pair[1]).is_file()] == []


def test_the_benchmarks_table_has_every_script() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    scripts = set(re.findall(r"^\| `(.*?\.py)` \|", page, re.MULTILINE))
    folders = (ROOT / "benchmarks", ROOT / "tests")
    found = {
        *(path.relative_to(folders[0]) for path in folders[0].rglob("*.py")),
        *(path.relative_to(ROOT) for path in (folders[1] / "endurance").glob("*.py")),
    }
    assert scripts == {str(path) for path in found if not path.name.startswith("_")}


def test_every_page_has_its_place_in_the_navigation() -> None:
    def leaves(node: object) -> list[str]:
        if isinstance(node, str):
            return [node]
        inner = node.values() if isinstance(node, dict) else node
        assert not isinstance(inner, (int, float)) and inner is not None
        return [name for each in inner for name in leaves(each)]  # type: ignore[attr-defined]

    named = set(leaves(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    pages = {str(p.relative_to(ROOT / "docs")) for p in (ROOT / "docs").rglob("*.md")}
    assert pages - named == set(), "name the page under nav in mkdocs.yml"
    assert named - pages == {"reference/command-line.md", "reference/settings.md"}


def test_the_outputs_page_explains_every_kind_of_reason() -> None:
    page = (ROOT / "docs" / "reference" / "outputs.md").read_text(encoding="utf-8")
    explained = set(re.findall(r"`([a-z-]+)`", page.partition("## How to read a reason")[2]))
    of_limits_only = {"short-path", "few-ranges", "gaps", "blocked", "heights"}
    assert {kind.value for kind in ReasonKind} - of_limits_only <= explained
