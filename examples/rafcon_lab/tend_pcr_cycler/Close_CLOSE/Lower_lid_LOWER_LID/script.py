def execute(self, inputs, outputs, gvm):
    getattr(gvm.get_variable("robot"), inputs["action"])(inputs["machine"])
    return "success"
