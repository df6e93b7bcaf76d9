"""A main execution that already asks a context manager, through helper functions of its own."""

DOORS = {"in": "entrance_open", "out": "exit_open"}


def pass_door(codra, robot, side):
    with codra.skill(f"pass_{side}"):
        if not _decide(codra, DOORS[side]):
            robot.push()
        if codra.get("people_near").value:
            robot.wait()


def _decide(codra, variable):
    answer = codra.decide(variable, otherwise=lambda: None)
    if answer is None:
        raise RuntimeError(variable)
    return bool(answer)


def main(codra, robot):
    pass_door(codra, robot, "in")
    pass_door(codra, robot, "out")
