def execute(self, inputs, outputs, gvm):
    outputs["localized"] = gvm.get_variable("robot").is_localized()
    return "success"
