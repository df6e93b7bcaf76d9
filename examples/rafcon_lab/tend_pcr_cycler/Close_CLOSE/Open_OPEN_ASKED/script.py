def execute(self, inputs, outputs, gvm):
    """Look as the robot did before there were observers: about 14 seconds a look."""
    seen = gvm.get_variable("eyes").look_for(inputs["variable"])
    return {True: "true", False: "false", None: "not seen"}[seen]
