def execute(self, inputs, outputs, gvm):
    """Return whether the variable equals the input `equals`; `unknown` if context does not know the value in time."""
    codra = gvm.get_variable("codra")
    value = codra.decide(self, inputs["variable"], wait_up_to_s=inputs["wait_up_to_s"])
    if value is None:
        return "unknown"
    return "true" if value == inputs["equals"] else "false"
