def execute(self, inputs, outputs, gvm):
    gvm.get_variable("robot").relocalize()
    return "success"
