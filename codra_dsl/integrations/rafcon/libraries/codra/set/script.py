def execute(self, inputs, outputs, gvm):
    """Write a variable as the main execution."""
    gvm.get_variable("codra").set(inputs["variable"], inputs["value"])
    return "success"
