"""What `spec.yaml` calls: it is read, and never imported."""


def look_at_hob(*, camera, job):
    return {"glow": camera.glow}


def look_at_door(*, camera, job):
    return {"gap": camera.gap_m}


def feel(*, distance, job):
    return {"heat": 50.0 / distance}


def look_at_lamp(camera):
    return {"light": camera.light_lux}
