def execute(self, inputs, outputs, gvm):
    """Return the outcome of the skill's preview; `unknown` if context does not decide it in time."""
    codra = gvm.get_variable("codra")
    answer = codra.preview(self, inputs["skill"], wait_up_to_s=inputs["wait_up_to_s"])
    outputs["reason"] = str(answer)
    return str(answer.outcome)
