"""The page of a report: one file that loads nothing else and shows all texts unchanged."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_papers.experiments.campaign.document import Document, Drawing, Photograph, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment
from codra_papers.experiments.campaign.page import render_page
from codra_papers.experiments.campaign.photographs import NoPictureError, annotated_jpeg
from codra_papers.experiments.campaign.provenance import Provenance, Revision
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.lab.perception.tags import tag_image

HOSTILE_TEXTS = (
    "</style><script>alert(1)</script>",
    "</section>",
    "<!--",
    "]]>",
    '" onload="alert(1)',
    "{{ 7 * 7 }}",
    "'",
)
FETCHING = {"src", "href", "srcset", "action", "data", "poster", "background", "formaction", "xlink:href"}
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><script>alert(1)</script><path d="M0 0h9"/></svg>'
EXPERIMENT = Experiment(
    name="any", question="What is shown?", seeds=0, trials=lambda _: (), judge=lambda *_: document(())
)
OUTCOME = Outcome(
    name="one",
    seed=101,
    duration_s=61.25,
    loops=1,
    error="the lid is stuck",
    frames=12,
    perceived=12,
    truth={},
    arms={},
    decisions=(),
    skills=(),
    interruptions=[],
    kept=(),
)
PROVENANCE = Provenance(
    command="codra experiment any --seeds 3",
    spec="specs/lab.yaml",
    versions={"codra": "0.1.0", "Python": "3.11.2"},
    code="0" * 64,
    revision=Revision(commit="1" * 40, is_clean=False),
    seeds=(101, 102),
    cores=2,
    processes=2,
    elapsed_s=73.4,
    reused_trial_count=5,
)


def document(parts: Sequence[Words | Table | Drawing | Photograph], summary: Sequence[str] = ()) -> Document:
    return Document(title="A title", summary=summary, sections=[Section(title="Found", parts=parts)], results={})


@dataclass
class Page(HTMLParser):
    """A page as a browser parses it: its elements, and the text within each kind of element."""

    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    texts: dict[str, list[str]] = field(default_factory=dict)
    open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self.texts.setdefault(tag, []).append("")
        if tag not in ("img", "meta"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, jpeg_bytes: str) -> None:
        for tag in set(self.open):
            self.texts[tag][-1] += jpeg_bytes

    def all(self, tag: str) -> Iterator[dict[str, str | None]]:
        return (attributes for name, attributes in self.elements if name == tag)


def page_of(*parts: Words | Table | Drawing | Photograph, summary: Sequence[str] = ()) -> Page:
    page = Page()
    page.feed(render_page(EXPERIMENT, document(parts, summary), {"one": OUTCOME}, PROVENANCE))
    page.close()
    assert page.open == []
    return page


@pytest.fixture
def photograph(tmp_path: Path) -> Photograph:
    """Return the picture of a grey wall with tag 10, as bright as a frame."""
    pixels = np.full((480, 640), 170, dtype=np.uint8)
    pixels[200:280, 300:380] = np.kron(tag_image(10), np.ones((8, 8), dtype=np.uint8))
    assert cv2.imwrite(str(tmp_path / "wall.png"), pixels)
    return Photograph(caption="The wall", path=tmp_path / "wall.png")


TABLE = Table(
    caption="Ratios.",
    header=("variable", "ratio", "interval", "why"),
    rows=[("open", 0.875, "0.81 to 0.92", None), ("locked", None, "-", True)],
    marked=frozenset({(0, 1)}),
)


def test_a_page_has_no_requests_and_no_scripts_and_forbids_them_in_its_policy(photograph: Photograph) -> None:
    page = page_of(Words(text="said"), TABLE, Drawing(caption="drawn", svg=SVG), photograph)
    fetched_addresses = [
        value or "" for _, attributes in page.elements for name, value in attributes.items() if name in FETCHING
    ]

    assert fetched_addresses
    assert all(value.startswith(("#", "data:image/")) for value in fetched_addresses)
    assert not {"script", "link", "iframe", "object", "embed", "form", "svg"} & page.texts.keys()
    assert not [name for _, attributes in page.elements for name in attributes if name.startswith("on")]
    (policy,) = (meta["content"] for meta in page.all("meta") if meta.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; style-src 'unsafe-inline'; img-src data:;")
    assert not re.search(r"url\(|@import", page.texts["style"][0])


def test_the_summary_is_first_and_the_contents_link_to_every_section() -> None:
    page = page_of(Words(text="said"), summary=["It was so.", "It was not."])
    targets = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    headings = [heading["id"] for heading in page.all("h2")]

    assert page.texts["h1"] == ["A title"]
    assert page.texts["h2"] == ["Summary", "Contents", "Found", "Made with", "Trials"]
    assert page.texts["li"][:2] == ["It was so.", "It was not."]
    assert [(link["href"] or "").removeprefix("#") for link in page.all("a")] == headings[2:]
    assert len(targets) == len(set(targets))
    assert all(section["aria-labelledby"] in targets for section in page.all("section"))


def test_a_table_has_headers_aligns_numbers_to_the_right_and_marks_cells() -> None:
    page = page_of(TABLE)
    header, body = list(page.all("th")), list(page.all("td"))

    assert [cell.get("class") for cell in header[:4]] == [None, "number", "number", None]
    assert [cell["scope"] for cell in header[:6]] == ["col"] * 4 + ["row"] * 2
    assert page.texts["td"][:6] == ["0.875", "0.81 to 0.92", "\u2013", "\u2013", "-", "yes"]
    assert body[0]["class"] == "number marked"
    assert page.texts["mark"][:2] == ["Marked", "0.875"]
    assert page.texts["caption"][0] == "Ratios. Marked cells need attention."
    assert page.texts["caption"][1].startswith("The inputs of this report.")


def test_a_table_without_rows_shows_none() -> None:
    empty_table = Table(caption="Errors.", header=("run", "at s", "error"), rows=[])

    assert page_of(empty_table).texts["td"][:2] == ["", ""]
    assert page_of(empty_table).texts["th"][:4] == ["run", "at s", "error", "none"]


@pytest.mark.parametrize(
    ("figure", "is_number"), [("1.5e-05", True), ("5.9e-123", True), ("e-05", False), ("1e", False)]
)
def test_a_very_small_number_is_a_number(figure: str, is_number: bool) -> None:
    page = page_of(Table(caption="Chance.", header=("part", "p"), rows=[("whole", figure)]))

    assert (next(page.all("td")).get("class") == "number") is is_number


def test_pictures_have_texts_and_a_drawing_is_embedded_completely(photograph: Photograph) -> None:
    page = page_of(Drawing(caption="drawn", svg=SVG), photograph, photograph)

    assert [image["alt"] for image in page.all("img")] == ["drawn", "The wall", "The wall"]
    assert page.texts["figcaption"] == ["drawn", "The wall", "The wall"]
    source = next(page.all("img"))["src"] or ""
    assert base64.b64decode(source.removeprefix("data:image/svg+xml;base64,")).decode() == SVG


def test_a_report_ends_with_its_provenance_and_all_trials() -> None:
    text = page_of().texts["body"][0]

    for text_part in (
        "codra experiment any --seeds 3",
        f"{'1' * 40}, with uncommitted changes",
        "101, 102",
        "2; 2 processes at once",
        "73 s for the trials that this call ran; 5 had been run before",
        "61.2",
        "the lid is stuck",
    ):
        assert text_part in text


@pytest.mark.parametrize("hostile_text", HOSTILE_TEXTS)
def test_markup_in_a_report_is_shown_as_text(hostile_text: str, tmp_path: Path) -> None:
    before = page_of(Words(text=""), Table(caption="", header=("",), rows=[("",)]), summary=[""])
    table = Table(caption=hostile_text, header=(hostile_text,), rows=[(hostile_text,)])
    page = page_of(Words(text=hostile_text), table, summary=[hostile_text])
    page_without_photograph = page_of(Photograph(caption=hostile_text, path=tmp_path / "gone.png"))

    assert [tag for tag, _ in page.elements] == [tag for tag, _ in before.elements]
    assert not list(page_without_photograph.all("img"))


@settings(max_examples=60)
@given(text=st.text(st.characters(exclude_categories=("Cs", "Cc"))))
def test_any_text_is_shown_unchanged(text: str) -> None:
    page = page_of(Table(caption=text, header=("a", text), rows=[(text, "b")]), Words(text=text), summary=[text])

    assert page.texts["li"][0] == text
    assert page.texts["caption"][0] == text
    assert page.texts["th"][1] == text
    assert text in page.texts["p"]


# Photographs


def test_a_photograph_has_its_tags_outlined_and_numbered(photograph: Photograph) -> None:
    jpeg_bytes = annotated_jpeg(photograph.path)
    decoded_image = cv2.imdecode(np.frombuffer(jpeg_bytes, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert decoded_image is not None
    blue, green, red = (decoded_image[:, :, channel].astype(int) for channel in range(3))

    assert decoded_image.shape == (480, 640, 3)
    assert len(jpeg_bytes) < 100_000
    rows, columns = np.nonzero((green > red + 60) & (green > blue + 60))
    assert len(rows) > 200
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == pytest.approx((208, 271, 308, 371), abs=2)
    rows, columns = np.nonzero((red > green + 60) & (red > blue + 60))
    assert rows.size
    assert rows.min() > 271


@pytest.mark.parametrize("jpeg_bytes", [None, b"", b"no picture at all"])
def test_an_unreadable_picture_is_replaced_by_the_reason(tmp_path: Path, jpeg_bytes: bytes | None) -> None:
    path = tmp_path / "frame.png"
    if jpeg_bytes is not None:
        path.write_bytes(jpeg_bytes)
    page = page_of(Photograph(caption="Lost", path=path))

    with pytest.raises(NoPictureError, match=str(path)):
        annotated_jpeg(path)
    assert not list(page.all("img"))
    assert page.texts["figcaption"] == ["Lost"]
    assert "No picture: " in page.texts["figure"][0]
