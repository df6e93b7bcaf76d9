"""Damage to XML: entities, document types, namespaces, attributes, elements and nesting."""

from __future__ import annotations

import re
from random import Random

from tests.campaigns.hostile.damage import damaged, encoded
from tests.campaigns.hostile.texts import NUMBERS, ODD_NAMES, TEXTS

_ELEMENT = re.compile(r"<[A-Za-z][^<>]*>")
_VALUE = re.compile(r"=\s*\"[^\"]*\"")
_NAME = re.compile(r"(?<=[</])[A-Za-z][\w:.-]*|[\w:.-]{1,60}(?==\")")
_LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
DOCTYPES = (
    f'<!DOCTYPE root [<!ENTITY l0 "lol">{_LAUGHS}]>',
    '<!DOCTYPE root SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE root [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE root [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x.dtd"> %p;]>',
    f'<!DOCTYPE root [<!ENTITY big "{"x" * 50_000}">]>',
    "<!DOCTYPE root [<!ATTLIST root a CDATA 'b'>]>",
    "<!doctype root>",
    "<!DOCTYPE",
    "<!ENTITY x 'y'>",
)
_INSERTS = (
    *("&l11;", "&x;", "&amp;", "&#0;", "&#x0;", "&#xD800;", "&#x110000;", "&#9;", "&#x202e;", "&#xfffe;", "&", "&#;"),
    *("<![CDATA[ x ]]>", "<![CDATA[", "]]>", "<!-- -->", "<!-- -- -->", "<!--", "<?php x?>", "<?xml version='1.0'?>"),
    *("<a/>", "<a>", "</a>", "<a:b/>", "<A B='1'/>", '<xi:include href="/etc/passwd"/>', "text", "<", ">", "'", "\x00"),
    *("<!-- " + "x" * 3000 + " -->", "<?" + "x" * 3000 + "?>", "<?x y?>" * 300, "<a/>" * 300),
)


def damaged_xml(chance: Random, text: str) -> bytes:
    """Return XML with a few edits, in UTF-8 or sometimes in another encoding."""
    for _ in range(chance.choice((1, 1, 2, 4))):
        kind = chance.random()
        if kind < 0.3:
            text = _edit_element(chance, text)
        elif kind < 0.5:
            value = chance.choice((*NUMBERS, *TEXTS, *ODD_NAMES[:-40], "{a}", "{=}", "{", "a;b", "&lt;", "'" * 9))
            text = _replaced(chance, _VALUE, text, f'="{value}"')
        elif kind < 0.62:
            text = _replaced(
                chance, _NAME, text, chance.choice((*ODD_NAMES[:40], "root", "ID", "name", "xmlns:a", "a:b"))
            )
        elif kind < 0.75:
            text = _inserted(chance, text, chance.choice(_INSERTS))
        elif kind < 0.8:
            end = text.find("?>") + 2 if text.startswith("<?xml") else 0
            text = text[:end] + chance.choice(DOCTYPES) + text[end:]
        elif kind < 0.84:
            text = text.replace("UTF-8", chance.choice(("UTF-16", "latin-1", "utf-7", "x" * 300, "", "ibm037")), 1)
        else:
            text = damaged(chance, text, (1, 2))
    return encoded(chance, text)


def _edit_element(chance: Random, text: str) -> str:
    """Delete, double, nest or move an element."""
    matches = list(_ELEMENT.finditer(text))
    if not matches:
        return text
    one, other = chance.choice(matches), chance.choice(matches)
    kind = chance.randrange(5)
    if kind == 0:
        return text[: one.start()] + text[one.end() :]
    if kind == 1:
        return text[: one.end()] + other.group() + text[one.end() :]
    if kind == 2:
        depth, tag = chance.choice((10, 60, 300, 20_000)), chance.choice(("a", "Sequence", "Inverter", "node", "graph"))
        return text[: one.start()] + f"<{tag}>" * depth + f"</{tag}>" * depth + text[one.start() :]
    if kind == 3:
        attributes = "".join(
            f' {name}="{number}"' for number in range(chance.choice((2, 70, 3000))) for name in (f"a{number}",)
        )
        end = one.end() - (2 if one.group().endswith("/>") else 1)
        return text[:end] + chance.choice((attributes, ' ID="a" ID="b"', " a", ' xmlns="x"', " ID='&x;'")) + text[end:]
    first, last = sorted((one.start(), other.end()))
    return text[:last] + text[first:last] * chance.choice((1, 1, 30)) + text[last:]


def _replaced(chance: Random, pattern: re.Pattern[str], text: str, replacement: str) -> str:
    matches = list(pattern.finditer(text))
    if not matches:
        return text
    match = chance.choice(matches)
    return text[: match.start()] + replacement + text[match.end() :]


def _inserted(chance: Random, text: str, inserted: str) -> str:
    matches = list(_ELEMENT.finditer(text))
    place = chance.choice(matches).end() if matches and chance.random() < 0.8 else chance.randrange(len(text) + 1)
    return text[:place] + inserted + text[place:]
