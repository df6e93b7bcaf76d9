from __future__ import annotations

import codecs
import errno
import os
from pathlib import Path

import pytest

from codra_dsl.language.load import find_files, load_spec, load_text
from codra_dsl.language.load.parts import MAX_INCLUDE_DEPTH, MAX_PARTS
from codra_dsl.language.load.yaml.source import MAX_BYTES

SPEC = "codra: 1\nname: kitchen\n"
PART = "codra: 1\nresources: {camera: {}}\n"


def write(root: Path, **texts: str) -> None:
    """Write files: `parts__jar` means parts/jar.yaml."""
    for name, text in texts.items():
        path = root / f"{name.replace('__', '/')}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")


def rules(path: Path, root: Path) -> list[str]:
    return [finding.rule.name for finding in load_spec(path, root)[1]]


def test_parts_are_read_in_the_order_in_which_they_are_included(tmp_path: Path) -> None:
    write(
        tmp_path,
        specs__kitchen=f"{SPEC}include: [parts/b.yaml, parts/a.yaml]\nresources: {{arm: {{}}}}\n",
        specs__parts__a="codra: 1\nresources: {a: {}}\n",
        specs__parts__b="codra: 1\ninclude: [../c.yaml]\nresources: {b: {}}\n",
        specs__c="codra: 1\nresources: {c: {}}\n",
    )
    spec, findings = load_spec(tmp_path / "specs" / "kitchen.yaml", tmp_path)

    assert findings == ()
    assert spec is not None
    assert spec.files == ("specs/kitchen.yaml", "specs/parts/b.yaml", "specs/c.yaml", "specs/parts/a.yaml")
    assert [resource.name for resource in spec.resources] == ["arm", "b", "c", "a"]


def test_a_template_may_come_from_a_part_that_another_part_includes(tmp_path: Path) -> None:
    write(
        tmp_path,
        kitchen=f"{SPEC}include: [uses.yaml]\n",
        uses="codra: 1\ninclude: [jar.yaml]\nuse: {sugar: {template: jar}}\n",
        jar="codra: 1\ntemplates: {jar: {resources: {$(instance)_lid: {}}}}\n",
    )
    spec, findings = load_spec(tmp_path / "kitchen.yaml", tmp_path)

    assert findings == ()
    assert spec is not None
    place = spec.resources[0].place
    assert (place.span.file, place.use and place.use.file) == ("jar.yaml", "uses.yaml")


def test_a_link_inside_the_project_is_followed_and_one_that_leads_out_is_not(tmp_path: Path) -> None:
    project = tmp_path / "project"
    write(tmp_path, secret=PART)
    write(project, real=PART, inside=f"{SPEC}include: [link.yaml]\n", outside=f"{SPEC}include: [outward.yaml]\n")
    (project / "link.yaml").symlink_to("real.yaml")
    (project / "outward.yaml").symlink_to("../secret.yaml")
    (project / "folder").symlink_to("..")
    write(project, around=f"{SPEC}include: [folder/secret.yaml]\n")

    assert rules(project / "inside.yaml", project) == []
    assert rules(project / "outside.yaml", project) == ["part-outside-project"]
    assert rules(project / "around.yaml", project) == ["part-outside-project"]


def test_a_part_is_the_same_under_any_name(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [jar.yaml, link.yaml]\n", jar=PART)
    (tmp_path / "link.yaml").symlink_to("jar.yaml")

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["part-included-twice"]


def test_a_spec_that_includes_itself_is_reported_with_the_cycle(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [jar.yaml]\n", jar="codra: 1\ninclude: [kitchen.yaml]\n")
    _, (finding,) = load_spec(tmp_path / "kitchen.yaml", tmp_path)

    assert finding.rule.name == "part-includes-itself"
    assert "kitchen.yaml -> jar.yaml -> kitchen.yaml" in finding.message


def test_a_long_list_of_includes_is_not_read_beyond_the_limit(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [{', '.join(['nowhere.yaml'] * 20 * MAX_PARTS)}]\n")

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["part-not-found"] * MAX_PARTS + ["too-many-parts"]


def test_a_chain_of_includes_ends_at_the_limit(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [part0.yaml]\n")
    write(tmp_path, **{f"part{n}": f"codra: 1\ninclude: [part{n + 1}.yaml]\n" for n in range(MAX_INCLUDE_DEPTH + 5)})

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["too-many-parts"]


def sparse(path: Path, size_bytes: int) -> None:
    """Make a file of a size whose content would be refused if it was read: it has only null characters."""
    with path.open("wb") as file:
        file.truncate(size_bytes)


def test_parts_that_are_too_large_together_are_refused_before_any_of_them_is_read(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [a.yaml, b.yaml, c.yaml]\nresources: {{arm: 3}}\n")
    for name in ("a", "b", "c"):
        sparse(tmp_path / f"{name}.yaml", MAX_BYTES // 2 - 1000)
    spec, findings = load_spec(tmp_path / "kitchen.yaml", tmp_path)

    assert spec is None
    assert [(finding.rule.name, finding.place.span.column) for finding in findings] == [("too-many-parts", 27)]


def test_a_part_of_a_part_counts_before_it_is_read(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [a.yaml, b.yaml]\n", a="codra: 1\ninclude: [c.yaml]\n")
    sparse(tmp_path / "b.yaml", MAX_BYTES // 2)
    sparse(tmp_path / "c.yaml", MAX_BYTES // 2)
    spec, findings = load_spec(tmp_path / "kitchen.yaml", tmp_path)

    assert spec is None
    assert [(finding.rule.name, finding.place.span.file) for finding in findings] == [("too-many-parts", "a.yaml")]


def test_a_part_that_is_too_large_alone_is_reported_as_such(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [a.yaml, b.yaml]\n", b="codra: 1\nresources: {arm: 3}\n")
    sparse(tmp_path / "a.yaml", MAX_BYTES + 1)

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["file-too-large", "wrong-type"]


def test_a_file_beyond_the_limit_is_a_spec_if_it_has_a_version_wherever_its_name_is(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{PART}\nname: kitchen\n", table="rows: []\n", small=SPEC)
    for name in ("kitchen", "table"):
        with (tmp_path / f"{name}.yaml").open("ab") as file:
            file.truncate(MAX_BYTES + 1)
    files = find_files([tmp_path], tmp_path)

    assert [path.stem for path in files.specs] == ["kitchen", "small"]
    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["file-too-large"]


def test_a_part_of_the_maximum_size_is_no_spec(tmp_path: Path) -> None:
    write(tmp_path, part=PART, small=SPEC)
    with (tmp_path / "part.yaml").open("ab") as file:
        file.truncate(MAX_BYTES)
    files = find_files([tmp_path], tmp_path)

    assert [path.stem for path in files.specs] == ["small"]
    assert [path.stem for path in files.parts] == ["part"]


def test_parts_given_as_text_count_with_the_size_of_the_text(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [a.yaml, b.yaml]\n", a=PART, b="")
    sparse(tmp_path / "b.yaml", MAX_BYTES - 10)

    assert [finding.rule.name for finding in load_spec(tmp_path / "kitchen.yaml", tmp_path, {"b.yaml": b""})[1]] == [
        "not-a-spec"
    ]


@pytest.mark.parametrize(
    ("path", "rule"),
    [
        ("/etc/passwd", "part-outside-project"),
        ("~/part.yaml", "part-outside-project"),
        ("../part.yaml", "part-outside-project"),
        ("a/../../part.yaml", "part-outside-project"),
        ("parts\\\\jar.yaml", "part-outside-project"),
        ("missing.yaml", "part-not-found"),
        (".", "part-not-found"),
        ("", "wrong-length"),
        ("http://example.org/part.yaml", "part-not-found"),
        ("x" * 5000, "part-not-found"),
        ("a\\u0085b.yaml", "control-character"),
    ],
)
def test_a_missing_or_forbidden_path_is_reported(tmp_path: Path, path: str, rule: str) -> None:
    write(tmp_path, kitchen=f'{SPEC}include: ["{path}"]\n')

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == [rule]


def test_a_pipe_does_not_block(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [pipe.yaml]\n")
    os.mkfifo(tmp_path / "pipe.yaml")

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["part-not-found"]
    assert rules(tmp_path / "pipe.yaml", tmp_path) == ["cannot-read"]


def test_a_link_to_itself_is_reported(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [loop.yaml]\n")
    (tmp_path / "loop.yaml").symlink_to("loop.yaml")

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["part-not-found"]
    assert rules(tmp_path / "loop.yaml", tmp_path) == ["cannot-read"]


def test_names_of_a_lost_part_are_not_reported_as_missing(tmp_path: Path) -> None:
    write(
        tmp_path,
        kitchen=f"{SPEC}include: [jar.yaml]\nuse: {{sugar: {{template: jar}}}}\n",
        jar="codra: 1\ntemplates: [",
    )

    assert rules(tmp_path / "kitchen.yaml", tmp_path) == ["yaml-syntax"]


def test_a_missing_file_or_a_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()

    assert rules(tmp_path / "project" / "none.yaml", tmp_path) == ["cannot-read"]
    assert rules(tmp_path / "project", tmp_path) == ["cannot-read"]
    assert rules(tmp_path / "nul\0.yaml", tmp_path) == ["cannot-read"]


def test_loading_a_file_outside_of_the_root_raises(tmp_path: Path) -> None:
    write(tmp_path, outside=SPEC)

    with pytest.raises(ValueError, match="subpath"):
        load_spec(tmp_path / "outside.yaml", tmp_path / "project")


def test_parts_of_standard_input_are_relative_to_the_projects_folder(tmp_path: Path) -> None:
    write(tmp_path, jar=PART)
    spec, findings = load_text(f"{SPEC}include: [jar.yaml]\n", "-", tmp_path)

    assert findings == ()
    assert spec is not None
    assert spec.files == ("-", "jar.yaml")
    assert set(spec.origins.values()) == {"jar"}


def test_specs_below_a_folder_are_listed_and_other_files_ignored(tmp_path: Path) -> None:
    write(
        tmp_path,
        b__kitchen=SPEC,
        a=f"{SPEC}resources: {{}}\n",
        flow="{codra: 1, resources: {}, name: flow}\n",
        late="resources: {name: {}}\nname: kitchen\n",
        broken="codra: 1\nname: [\n",
        part="codra: 1\nresources: {name: {}}\n",
        compose="services: {web: {}}\nname: web\n",
        numbers="- name: 1\n",
        hidden__x="",
    )
    write(tmp_path / ".hidden", spec=SPEC)
    (tmp_path / "spec.yml").write_text(SPEC, "utf-8")
    (tmp_path / "spec.txt").write_text(SPEC, "utf-8")
    files = find_files([tmp_path, tmp_path / "a.yaml"], tmp_path)

    assert files.diagnostics == ()
    assert [file.relative_to(tmp_path).as_posix() for file in files.specs] == [
        "a.yaml",
        "b/kitchen.yaml",
        "broken.yaml",
        "flow.yaml",
        "late.yaml",
        "spec.yml",
    ]


def test_a_folder_without_specs_is_reported(tmp_path: Path) -> None:
    write(tmp_path, part=PART)
    files = find_files([tmp_path], tmp_path)

    assert files.specs == ()
    assert [finding.rule.name for finding in files.diagnostics] == ["no-spec"]


def test_a_file_given_as_a_path_is_treated_as_a_spec(tmp_path: Path) -> None:
    write(tmp_path, part=PART)
    files = find_files([tmp_path / "part.yaml", tmp_path / "none.yaml"], tmp_path)

    assert files.diagnostics == ()
    assert [rules(file, tmp_path) for file in files.specs] == [["cannot-read"], ["part-without-spec"]]


def test_an_unreadable_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The superuser can read every folder, so the test raises the error itself."""
    write(tmp_path, kitchen=SPEC)
    (tmp_path / "shut").mkdir()
    scandir = os.scandir

    def refusing(path: str) -> object:
        if Path(path).name == "shut":
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refusing)
    files = find_files([tmp_path], tmp_path)

    assert [file.name for file in files.specs] == ["kitchen.yaml"]
    assert [finding.message for finding in files.diagnostics] == ["cannot read the folder 'shut'"]


def test_a_spec_saved_as_utf_16_is_recognised_as_a_spec(tmp_path: Path) -> None:
    for mark, encoding in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        (tmp_path / f"{encoding}.yaml").write_bytes(mark + SPEC.encode(encoding))

    files = find_files([tmp_path], tmp_path)

    assert [rules(file, tmp_path) for file in files.specs] == [["not-utf-8"]] * 2


def test_a_part_is_named_by_its_place_even_through_a_link(tmp_path: Path) -> None:
    write(tmp_path / "robots", kitchen=f"{SPEC}include: [parts/jar.yaml]\n")
    write(tmp_path / "robots/parts", jar=PART)
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/kitchen.yaml").symlink_to("../robots/kitchen.yaml")

    spec, _ = load_spec(tmp_path / "specs/kitchen.yaml", tmp_path)

    assert spec is not None
    assert spec.files == ("specs/kitchen.yaml", "robots/parts/jar.yaml")


def test_a_part_that_no_spec_includes_is_reported(tmp_path: Path) -> None:
    write(tmp_path, kitchen=f"{SPEC}include: [jar.yaml]\n", jar=PART, lost=f"# lost\n{PART}")
    write(tmp_path, **{"other": "nmae: other\nservices: {}\n"})

    files = find_files([tmp_path], tmp_path)
    (lost,) = files.unincluded(["kitchen.yaml", "jar.yaml"], tmp_path)

    assert (lost.rule.name, lost.place.span.file, lost.place.span.line) == ("unincluded-part", "lost.yaml", 2)


def test_without_a_version_the_other_mistakes_of_a_file_are_still_reported() -> None:
    _, findings = load_text("name: kitchen\ncontext: {near: {type: bol}}\n", "-", Path(__file__).parent)

    assert [finding.code for finding in findings] == ["CDR2002", "CDR2006"]
