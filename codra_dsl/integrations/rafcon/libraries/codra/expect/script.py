def execute(self, inputs, outputs, gvm):
    """Say which skills come next, with commas between their names."""
    names = [name.strip() for name in inputs["skills"].split(",")]
    gvm.get_variable("codra").expect(*[name for name in names if name])
    return "success"
