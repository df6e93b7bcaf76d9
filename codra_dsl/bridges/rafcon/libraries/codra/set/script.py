def execute(self, inputs, outputs, gvm):
    gvm.get_variable("codra").set(inputs["variable"], inputs["value"])
    return "success"
