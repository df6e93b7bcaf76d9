def execute(self, inputs, outputs, gvm):
    """Announce the skills that come next; the input has commas between their names."""
    names = [name.strip() for name in inputs["skills"].split(",")]
    gvm.get_variable("codra").expect(*[name for name in names if name])
    return "success"
