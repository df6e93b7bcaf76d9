"""Uses of templates: their arguments, and the elements that they create."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.language.diagnostics import Place, Related, replacement_fix, surely_means
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.elements import Elements, report_duplicate_name
from codra_dsl.language.load.schema.document import Document
from codra_dsl.language.load.schema.keys_and_values import explain
from codra_dsl.language.load.schema.misspelt_names import NO_WORDS, misspelt_declarations
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.site.overlay import Overlay
from codra_dsl.language.load.templates.arguments import Arguments, read_arguments
from codra_dsl.language.load.templates.declared import declared_template
from codra_dsl.language.load.templates.substitution import Filler, example_value
from codra_dsl.language.load.templates.templates import EXAMPLES, Template, declare
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.model import DeclaredTemplate, Literal, Reference, Use

_ARGUMENT_WRAPPER_KEYS = ("parameters", "arguments", "with")
MAX_CREATED_VALUES = 1_500_000
"""The maximum number of values that all uses of a spec may create."""


class Uses:
    """The templates of a spec and their uses.

    Attributes:
        valid_uses: the valid uses, in file order.
        is_complete: whether the names of all created elements are known.
    """

    def __init__(self, findings: Findings, overlay: Overlay | None = None, *, may_lack_templates: bool) -> None:
        """Initialize.

        Args:
            findings: where findings are added.
            overlay: the arguments that a site replaces.
            may_lack_templates: whether templates may be missing because a part could not be read.
        """
        self.valid_uses: list[Use] = []
        self.is_complete = not may_lack_templates
        self._may_lack_templates = may_lack_templates
        self._findings = findings
        self._overlay = overlay
        self._templates: dict[str, Template] = {}
        self._corrections: dict[str, str] = {}
        self._first_subjects: dict[tuple[str, str], Subject] = {}
        self._used_templates: set[str] = set()
        self._named_templates: set[str] = set()

    def declare(self, documents: Iterable[Document]) -> None:
        """Add the templates that the documents declare."""
        declarations = [entry for document in documents for entry in _entries(document, "templates")]
        uses = _UsedNames(use for document in documents for use in self._uses(document))
        self._corrections = self._report_misspelt_templates(declarations, uses)
        used_names = {declared: used for used, declared in self._corrections.items()}
        for subject, node in declarations:
            if not isinstance(node, MappingNode):
                explain("template", node, subject, self._findings)
                self.is_complete, self._may_lack_templates = False, True
            elif self._is_new(subject):
                argument_names = uses.argument_names(used_names.get(subject.name, subject.name))
                template = declare(subject, node, argument_names, self._findings)
                self._templates[subject.name] = template
                self.is_complete &= not template.is_lost

    def _report_misspelt_templates(
        self, declarations: Iterable[tuple[Subject, YamlNode]], uses: _UsedNames
    ) -> dict[str, str]:
        """Report templates whose declared names are misspelt.

        Return a mapping from the name in the uses to the declared name of each of these templates.
        """
        subjects_by_name = {subject.name: subject for subject, _ in declarations}
        use_counts = {name: len(places) for name, places in uses.places.items() if name not in subjects_by_name}
        if not use_counts or self._may_lack_templates:
            return {}
        unused_names = [name for name in subjects_by_name if name not in uses.places]
        misspelt_templates = misspelt_declarations(
            use_counts, unused_names, subjects_by_name, NO_WORDS, self._findings.nearest
        )
        for name, misspelt_name in misspelt_templates.items():
            subject = subjects_by_name[misspelt_name]
            place = subject.origin.of(subject.key)
            message = f"{subject} is never used, and template {shown(name)} is not declared"
            related = [Related(f"{shown(name)} is used here", use_place) for use_place in uses.places[name]]
            fix = replacement_fix(place, misspelt_name, name, safe=False)
            help_text = f"did you mean '{name}'?"
            self._findings.add(
                "unknown-template", message, place, help=help_text, path=subject.path, related=related, fix=fix
            )
        return misspelt_templates

    def create_elements(self, documents: Iterable[Document], modules: Mapping[str, str], elements: Elements) -> None:
        """Add the elements that the uses in the documents create; `modules` maps the name of each use to its module."""
        uses_with_template: list[tuple[Subject, YamlNode, Template]] = []
        size = 0
        for subject, node in (use for document in documents for use in self._uses(document)):
            template = self._template(subject, node)
            if template is None:
                self.is_complete = False
                continue
            self._named_templates.add(template.name)
            uses_with_template.append((subject, node, template))
            size += template.size
            if size > MAX_CREATED_VALUES:
                self.is_complete = False
                message = f"all uses together create more than {MAX_CREATED_VALUES} values"
                place, path = subject.origin.of(subject.key), subject.path
                self._findings.add("too-many-values", message, place, help="use smaller templates", path=path)
                return
        for subject, node, template in uses_with_template:
            self._use(subject, node, template, modules.get(subject.name, subject.name), elements)

    def _use(self, subject: Subject, node: YamlNode, template: Template, module: str, elements: Elements) -> None:
        arguments = read_arguments(subject, node, template, self._findings)
        if not self._is_new(subject) or not arguments.is_valid:
            _record_lost_names(template, arguments, elements)
            return
        self._used_templates.add(template.name)
        self.valid_uses.append(_use(subject, node, template))
        key = subject.origin.source.span(subject.key.start, subject.key.end)
        self._fill(template, arguments, Origin(template.origin.source, key, template.name, module), elements)

    def declared_templates(self) -> Iterator[DeclaredTemplate]:
        """Yield the templates as they are declared, in file order."""
        for name, template in self._templates.items():
            yield declared_template(template, is_used=name in self._named_templates or not self.is_complete)

    def try_unused_templates(self) -> None:
        """Instantiate each template without a valid use, with example values, so that mistakes in it are found."""
        for name, template in self._templates.items():
            if name not in self._used_templates:
                bound_values = {key: example_value(parameter) for key, parameter in template.parameters.items()}
                self._fill(template, Arguments(bound_values, is_valid=True), template.origin, Elements(self._findings))

    def _uses(self, document: Document) -> Iterator[tuple[Subject, YamlNode]]:
        """Yield the uses in a document, with the arguments that a site states."""
        return _entries(document, "use", self._overlay)

    def _is_new(self, subject: Subject) -> bool:
        """Report an invalid or duplicate name; return whether the name can be used."""
        is_valid = check_name(subject.key, subject, subject, self._findings)
        first = self._first_subjects.setdefault((subject.section, subject.name.casefold()), subject)
        if first is not subject:
            report_duplicate_name(subject, first, self._findings)
        return first is subject and (is_valid or subject.section == "templates")

    def _template(self, subject: Subject, node: YamlNode) -> Template | None:
        """Return the template that a use names, or None if it is unknown."""
        if isinstance(node, MappingNode):
            self._correct_keys(subject, node)
        name = node.value("template") if isinstance(node, MappingNode) else None
        if not has_shape("template_use", node.data):
            explain("template_use", node, subject, self._findings, self._examples(name))
        if not isinstance(name, ScalarNode) or name.reported or not isinstance(name.data, str):
            return None
        template = self._templates.get(self._corrections.get(name.text, name.text))
        if template is None and not self._may_lack_templates:
            suggestion = self._findings.nearest(name.text, self._templates)
            templates_text = (
                f"templates are {list_names(self._templates)}" if self._templates else "no templates are declared"
            )
            help_text = f"did you mean '{suggestion}'?" if suggestion else templates_text
            message = f"unknown template {shown(name.text)} in {subject}"
            path = subject.part("template")
            place = subject.origin.of(name)
            is_safe = suggestion in self._named_templates and surely_means(name.text, suggestion or "", self._templates)
            fix = replacement_fix(place, name.text, suggestion, safe=is_safe) if suggestion else None
            self._findings.add("unknown-template", message, place, help=help_text, path=path, fix=fix)
        return template

    def _examples(self, template_name: YamlNode | None) -> Mapping[str, Literal]:
        """Return an example value for each parameter of a template; no examples for an unknown template."""
        name = template_name.data if isinstance(template_name, ScalarNode) else None
        template = self._templates.get(name) if isinstance(name, str) else None
        parameters = template.parameters if template is not None else {}
        return {name: EXAMPLES[parameter.kind][1] for name, parameter in parameters.items()}

    def _correct_keys(self, subject: Subject, node: MappingNode) -> None:
        """Report arguments in a separate mapping, and a wrong key in place of `template`; correct the node."""
        arguments_key = next((key for key in _ARGUMENT_WRAPPER_KEYS if isinstance(node.value(key), MappingNode)), None)
        if arguments_key is not None:
            place, path = subject.origin.of(node.entries[arguments_key][0]), subject.part(arguments_key)
            message, help_text = (
                f"the arguments are under {shown(arguments_key)} in {subject}",
                "write them next to 'template', as keys of the use",
            )
            self._findings.add("unknown-argument", message, place, help=help_text, path=path)
            for key, value in entries(node.take(arguments_key)):
                if key.text not in node.entries:
                    node.put(key, value)
        template_keys = [
            key
            for key, (_, value) in node.entries.items()
            if isinstance(value, ScalarNode) and value.data in self._templates
        ]
        if "template" not in node.entries and len(template_keys) == 1:
            key_node, value = node.entries[template_keys[0]]
            place, path = subject.origin.of(key_node), subject.part(template_keys[0])
            message, help_text = f"unknown key {shown(template_keys[0])} in {subject}", "did you mean 'template'?"
            fix = replacement_fix(place, template_keys[0], "template", safe=False)
            self._findings.add("unknown-key", message, place, help=help_text, path=path, fix=fix)
            node.take(template_keys[0])
            node.put(ScalarNode("template", "template", key_node.start, key_node.end, key_node.style), value)

    def _fill(self, template: Template, arguments: Arguments, origin: Origin, elements: Elements) -> None:
        """Instantiate a template with arguments, and add the resulting elements."""
        filler = Filler(template, arguments.bound_values)
        sections = filler.sections()
        filler.report(origin, self._findings)
        for section, mapping in sections.items():
            wrong_keys = {
                name: keys for (section_name, name), keys in template.damaged.items() if section_name == section
            }
            elements.add(section, mapping, origin, wrong_keys)


def _use(subject: Subject, node: YamlNode, template: Template) -> Use:
    name = node.value("template") if isinstance(node, MappingNode) else None
    return Use(
        instance=subject.name,
        template=template.name,
        place=subject.origin.of(subject.key),
        template_place=subject.origin.of(name or subject.key),
        arguments=tuple(
            Reference(name=key.text, place=subject.origin.of(key)) for key, value in entries(node) if value is not name
        ),
    )


class _UsedNames:
    """The names of templates and arguments in all uses, collected before the templates are read.

    Attributes:
        places: the places of the uses of each template.
    """

    def __init__(self, uses: Iterable[tuple[Subject, YamlNode]]) -> None:
        self.places: dict[str, list[Place]] = {}
        self._argument_names_by_template: dict[str, list[str]] = {}
        for subject, node in uses:
            name = node.value("template") if isinstance(node, MappingNode) else None
            if isinstance(name, ScalarNode) and isinstance(name.data, str) and not name.reported:
                self.places.setdefault(name.text, []).append(subject.origin.of(name))
                argument_names = self._argument_names_by_template.setdefault(name.text, [])
                argument_names.extend(key.text for key, value in entries(node) if value is not name)

    def argument_names(self, template: str) -> list[str]:
        """Return the names of all arguments in all uses of a template."""
        return self._argument_names_by_template.get(template, [])


def _record_lost_names(template: Template, arguments: Arguments, elements: Elements) -> None:
    """Record the names that an invalid use would have created."""
    for section, mapping in Filler(template, arguments.bound_values).sections().items():
        for name in mapping.entries:
            elements.record_lost(section, name)


def _entries(document: Document, section: str, overlay: Overlay | None = None) -> Iterator[tuple[Subject, YamlNode]]:
    for key, node in entries(document.section(section)):
        subject = Subject(section, key, document.origin)
        yield (subject, node) if overlay is None else overlay.apply(subject, node)
