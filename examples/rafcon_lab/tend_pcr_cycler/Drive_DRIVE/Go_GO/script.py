from codra_papers.lab.robot import Station


def execute(self, inputs, outputs, gvm):
    gvm.get_variable("robot").drive_to(Station(inputs["station"]))
    return "success"
