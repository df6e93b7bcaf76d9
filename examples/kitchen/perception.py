"""The robot's perception of the kitchen: each function reads the handle `kitchen` and returns values of the spec."""


def result_of_picture(job, processing_s, **values):
    job.evidence(job.now_s(), job.now_s())  # the picture is taken at this instant
    job.sleep(processing_s)  # processing it takes time
    return values


def measure_distance(*, kitchen, target, offset, job):
    return {"distance": abs(kitchen.place_m[target] - kitchen.robot_m) + offset}


def look_at_door(*, kitchen, door, job):
    return result_of_picture(job, 0.5, angle=kitchen.angle_rad.get(door), edges=kitchen.edges)


def find_kettle(*, kitchen, job):
    return {"bearing": kitchen.kettle_bearing_rad}


def ask_dock(*, kitchen, job):
    return {"contact": kitchen.kettle_docked}


def look_at_kettle(*, kitchen, job):
    values = {
        "water": kitchen.water_kg,
        "steam": kitchen.steam,
        "warmth": kitchen.warmth,
        "sharpness": kitchen.sharpness,
    }
    return result_of_picture(job, kitchen.kettle_work_s, **values)


def weigh_kettle(*, kitchen, job):
    return {"weight": (kitchen.water_kg + 0.9) * 9.81}


def look_at_hob(*, kitchen, job):
    return result_of_picture(job, 0.3, lamp=kitchen.lamp, power=kitchen.power_w, pot=kitchen.pot_on_hob)


def look_into_pot(*, kitchen, hob_power, job):
    return {"fill": kitchen.fill + (job.random.uniform(-5, 5) if hob_power > 1000 else 0)}
