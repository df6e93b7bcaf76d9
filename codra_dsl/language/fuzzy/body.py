"""Write the body of a compiled function, in FuzzyLite's order: memberships, rules block by block, and outputs."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

from codra_dsl.language.fuzzy.check import concluded_terms, depends_on_inputs, names_in, natural_weighting
from codra_dsl.language.fuzzy.dialects import Dialect, Kind, literal, snake_case, tuple_of
from codra_dsl.language.fuzzy.model import (
    And,
    Antecedent,
    AnyTerm,
    Engine,
    FormulaTerm,
    OutputVariable,
    Proposition,
    Rule,
    RuleBlock,
    Term,
    propositions,
)
from codra_dsl.language.fuzzy.names import Names
from codra_dsl.language.fuzzy.shapes import inverse, membership
from codra_dsl.language.fuzzy.words import Defuzzification, Hedge, Method, Shape, Weighting


def _hedge_function(word: Hedge) -> str:
    return f"hedges.{word}_" if word in (Hedge.ANY, Hedge.NOT) else f"hedges.{word}"


class Body:
    """Writes one of the two functions of an engine.

    Attributes:
        conclusions: the conclusions about each output, in the order in which they act. Each conclusion is a pair: the
            index of its term, and its implication.
    """

    def __init__(
        self, engine: Engine, dialect: Dialect, constants: Mapping[str, str], taken_names: frozenset[str]
    ) -> None:
        self._engine = engine
        self._dialect = dialect
        self._constants = constants
        self._names = Names(taken_names)
        self._locals = {variable.name: self._names.claim(variable.name) for variable in engine.inputs}
        self._inputs = list(self._locals.values())
        self._result_names = {output.name: self._names.claim(output.name) for output in engine.outputs}
        self._memberships: dict[tuple[str, str], str] = {}
        self._lines: list[str] = []
        self._strength_names: list[str] = []
        self._previous_names: dict[str, int] = {}
        self._acting_degrees: dict[str, list[tuple[str, str]]] = {output.name: [] for output in engine.outputs}
        self.conclusions: dict[str, list[tuple[int, str]]] = {output.name: [] for output in engine.outputs}

    def function(self, name: str) -> str:
        """Return the source of the function."""
        self._assign_inputs()
        blocks = [block for block in self._engine.blocks if block.is_enabled]
        self._assign_memberships(blocks)
        for block in blocks:
            self._write_block(block)
        for output in self._engine.outputs:
            self._write_output(output)
        dialect, count = self._dialect, len(self._engine.outputs)
        unknown_value = "math.nan" if dialect.has_numbers else "bounds.UNKNOWN"
        inputs = "".join(f"    {argument}: {dialect.value_type},\n" for argument in self._inputs)
        previous = f"    *,\n    previous: tuple[{dialect.value_type}, ...] = ({unknown_value},) * {count},\n"
        values = tuple_of([self._result_names[output.name] for output in self._engine.outputs])
        strengths = tuple_of(self._strength_names) if self._strength_names else "()"
        lines = [*self._lines, f"return {dialect.inference_type}({values}, {strengths})"]
        docstring = (
            '    """Return the outputs and the strengths of the rules; `previous` has the previous outputs."""\n'
        )
        body = "".join(f"    {line}\n" for line in self._drop_unused_lines(lines))
        return f"def {name}(\n{inputs}{previous}) -> {dialect.inference_type}:\n{docstring}{body}".rstrip()

    def _assign(self, name: str, source: str) -> str:
        self._lines.append(f"{name} = {source}")
        return name

    def _assign_inputs(self) -> None:
        for variable in self._engine.inputs:
            if variable.is_locked:
                name = self._locals[variable.name]
                self._assign(
                    name,
                    f"{self._dialect.clip_function}({name}, {_range_arguments(variable.minimum, variable.maximum)})",
                )
        for index, output in enumerate(self._engine.outputs):
            if self._needs_previous(output):
                previous_name = self._names.claim(f"{self._result_names[output.name]}_before")
                self._previous_names[previous_name] = index
                self._locals[output.name] = self._assign(previous_name, f"previous[{index}]")

    def _drop_unused_lines(self, lines: list[str]) -> list[str]:
        """Return the lines, except each line that assigns a previous value to a name that no other line uses."""
        names_by_line = {f"{name} = previous[{index}]": name for name, index in self._previous_names.items()}
        word_counts = Counter(word for line in lines for word in re.findall(r"\w+", line))
        return [line for line in lines if line not in names_by_line or word_counts[names_by_line[line]] > 1]

    def _needs_previous(self, output: OutputVariable) -> bool:
        formulas = [
            term.formula
            for variable in self._engine.variables
            for term in variable.terms
            if isinstance(term, FormulaTerm)
        ]
        is_named = any(output.name in names_in(formula) for formula in formulas)
        return is_named or output.keeps_previous or not output.is_enabled

    def _assign_memberships(self, blocks: Iterable[RuleBlock]) -> None:
        """Assign each membership degree that a rule reads to a name, so that it is computed only once."""
        needed_terms = {
            (proposition.variable, proposition.term): None
            for block in blocks
            for rule in block.rules
            for proposition in propositions(rule.antecedent)
        }
        for variable in self._engine.inputs:
            for term in variable.terms:
                if variable.is_enabled and (variable.name, term.name) in needed_terms:
                    name = self._names.claim(f"{self._locals[variable.name]}_{term.name}")
                    source = self._membership(term, self._locals[variable.name])
                    self._memberships[variable.name, term.name] = self._assign(name, source)

    def _membership(self, term: AnyTerm, x: str) -> str:
        return membership(term, x, self._locals, self._inputs, self._dialect)

    # Rules

    def _write_block(self, block: RuleBlock) -> None:
        assert block.activation is not None
        method, count = block.activation.method, len(self._strength_names)
        rules = [
            (rule, self._names.claim(f"rule_{count + number}")) for number, rule in enumerate(block.rules, start=1)
        ]
        self._strength_names += [name for _, name in rules]
        if method in (Method.HIGHEST, Method.LOWEST, Method.PROPORTIONAL):
            self._activate_together(block, rules)
            return
        gate = ""
        if method in (Method.FIRST, Method.LAST):
            gate_arguments = f"{block.activation.rules}, {literal(block.activation.threshold)}"
            gate = self._assign(self._names.claim("gate"), f"{self._dialect.activations}.Gate({gate_arguments})")
        for rule, name in reversed(rules) if method is Method.LAST else rules:
            self._assign(name, self._strength(rule, block))
            self._conclude(rule, self._acting_degree(name, block, gate), block)

    def _acting_degree(self, name: str, block: RuleBlock, gate: str) -> str:
        assert block.activation is not None
        if gate:
            return self._assign(self._names.claim(f"acting_{name}"), f"{gate}.admit({name})")
        if block.activation.method is not Method.THRESHOLD:
            return name
        comparator, limit = block.activation.comparator, block.activation.threshold
        source = f"{self._dialect.activations}.threshold({name}, {literal(str(comparator))}, {literal(limit)})"
        return self._assign(self._names.claim(f"acting_{name}"), source)

    def _activate_together(self, block: RuleBlock, rules: list[tuple[Rule, str]]) -> None:
        assert block.activation is not None
        for rule, name in rules:
            self._assign(name, self._strength(rule, block))
        if not rules:
            return
        acting_names = [self._names.claim(f"acting_{name}") for _, name in rules]
        method = block.activation.method
        limit_argument = "" if method is Method.PROPORTIONAL else f", {block.activation.rules}"
        degrees = tuple_of([name for _, name in rules])
        self._assign(
            tuple_of(acting_names), f"{self._dialect.activations}.{snake_case(method)}({degrees}{limit_argument})"
        )
        for (rule, _), degree in zip(rules, acting_names, strict=True):
            self._conclude(rule, degree, block)

    def _strength(self, rule: Rule, block: RuleBlock) -> str:
        source = self._antecedent(rule.antecedent, block)
        return source if rule.weight == 1.0 else self._dialect.times(rule.weight, source)

    def _antecedent(self, part: Antecedent, block: RuleBlock) -> str:
        if isinstance(part, Proposition):
            return self._proposition(part)
        norm = block.conjunction if isinstance(part, And) else block.disjunction
        assert norm is not None
        sides = (self._antecedent(part.left, block), self._antecedent(part.right, block))
        return self._dialect.call(Kind.NORM, f"norms.{snake_case(norm)}", *sides)

    def _proposition(self, part: Proposition) -> str:
        variable = self._engine.variable(part.variable)
        if not variable.is_enabled:
            return self._dialect.number(0.0)
        if part.hedges and part.hedges[-1] is Hedge.ANY:
            source = self._dialect.number(1.0)
            hedges = part.hedges[:-1]
        else:
            source, hedges = self._degree(part, variable), part.hedges
        for hedge in reversed(hedges):
            source = self._dialect.call(Kind.HEDGE, _hedge_function(hedge), source)
        return source

    def _degree(self, part: Proposition, variable: object) -> str:
        if not isinstance(variable, OutputVariable):
            return self._memberships[part.variable, part.term]
        degrees = [degree for term, degree in self._acting_degrees[part.variable] if term == part.term]
        aggregation = f"norms.{snake_case(variable.aggregation or 'UnboundedSum')}"
        degrees_tuple = tuple_of(degrees) if degrees else "()"
        return f"{self._dialect.outputs}.degree_so_far({aggregation}, {degrees_tuple})"

    def _conclude(self, rule: Rule, degree: str, block: RuleBlock) -> None:
        """Record the conclusions of a rule; hedges of one conclusion also apply to the next ones, as in FuzzyLite."""
        implication = f"norms.{snake_case(block.implication or 'Minimum')}"
        for conclusion in rule.conclusions:
            output = self._engine.variable(conclusion.variable)
            if not output.is_enabled or not isinstance(output, OutputVariable):
                continue
            for hedge in reversed(conclusion.hedges):
                degree = f"{self._dialect.activations}.hedged({degree}, {_hedge_function(hedge)})"
            if conclusion.hedges:
                degree = self._assign(self._names.claim(f"concluded_{output.name}"), degree)
            terms = concluded_terms(output, self._engine)
            index = next(at for at, term in enumerate(terms) if term.name == conclusion.term)
            self._acting_degrees[output.name].append((conclusion.term, degree))
            self.conclusions[output.name].append((index, implication))

    # Outputs

    def _write_output(self, output: OutputVariable) -> None:
        result_name, dialect = self._result_names[output.name], self._dialect
        if not output.is_enabled:
            self._locals[output.name] = self._assign(result_name, self._locals[output.name])
            return
        assert output.defuzzifier is not None
        is_weighted = output.defuzzifier.method.is_weighted
        self._assign(result_name, self._weighted_value(output) if is_weighted else self._integral_value(output))
        substitutes = [self._locals[output.name]] if output.keeps_previous else []
        substitutes += [] if output.default is None else [dialect.number(output.default)]
        if substitutes:
            self._assign(result_name, f"{dialect.first_known_function}({', '.join([result_name, *substitutes])})")
        if output.is_locked:
            self._assign(
                result_name,
                f"{dialect.clip_function}({result_name}, {_range_arguments(output.minimum, output.maximum)})",
            )
        self._locals[output.name] = result_name

    def _degrees(self, output: OutputVariable) -> str:
        degree_names = [degree for _, degree in self._acting_degrees[output.name]]
        return tuple_of(degree_names) if degree_names else "()"

    def _integral_value(self, output: OutputVariable) -> str:
        constant, degrees = self._constants[output.name], self._degrees(output)
        terms = concluded_terms(output, self._engine)
        memberships = ""
        if depends_on_inputs(output, self._engine):
            memberships = tuple_of([f"lambda x: {self._membership(term, 'x')}" for term in terms])
        if self._dialect.has_numbers:
            integral = f"outputs.shaped({constant}, {memberships})" if memberships else constant
            return f"{integral}.value({degrees})"
        return f"bounded_outputs.integral({', '.join([constant, degrees, *([memberships] if memberships else [])])})"

    def _weighted_value(self, output: OutputVariable) -> str:
        constant, degrees = self._constants[output.name], self._degrees(output)
        terms = concluded_terms(output, self._engine)
        values = tuple_of([self._term_value(term, output) for term in terms]) if terms else "()"
        is_average = output.defuzzifier and output.defuzzifier.method is Defuzzification.WEIGHTED_AVERAGE
        if self._dialect.has_numbers:
            return f"{constant}.{'average' if is_average else 'sum'}({degrees}, {values})"
        return f"bounded_outputs.{'average' if is_average else 'total'}({constant}, {degrees}, {values})"

    def _term_value(self, term: AnyTerm, output: OutputVariable) -> str:
        """Return the source text of a concluded term's number: a value, or a function of the term's degree."""
        assert output.defuzzifier is not None
        weighting = output.defuzzifier.weighting
        if weighting is Weighting.AUTOMATIC:
            weighting = natural_weighting(term)
        if weighting is Weighting.TSUKAMOTO and isinstance(term, Term):
            return f"lambda y: {inverse(term, 'y', self._dialect)}"
        if isinstance(term, Term) and term.shape is Shape.Constant:
            return self._dialect.number(term.parameters[0])
        if isinstance(term, Term) and term.shape is Shape.Linear:
            return self._membership(term, "x")
        source = self._membership(term, "x")
        needs_x = not isinstance(term, FormulaTerm) or "x" in names_in(term.formula)
        return f"lambda x: {source}" if needs_x else source


def _range_arguments(minimum: float, maximum: float) -> str:
    return f"{literal(minimum)}, {literal(maximum)}"
