def execute(self, inputs, outputs, gvm):
    names = [name.strip() for name in inputs["skills"].split(",")]
    gvm.get_variable("codra").expect(*[name for name in names if name])
    return "success"
