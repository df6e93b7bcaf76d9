"""A patrol with a navigator whose tasks run in the background, as in ROS 2."""

import rclpy
from navigation import Navigator, Result

ROUTE = ["hall", "office"]


def main():
    rclpy.init()
    navigator = Navigator()
    while rclpy.ok():
        for place in ROUTE:
            navigator.go_to(place)
            wait_for(navigator)
            result = navigator.get_result()
            if result == Result.FAILED:
                recover(navigator)
            elif people := [person for person in navigator.people() if person.distance < 2.0]:
                navigator.greet(people)


def wait_for(navigator):
    count = 0
    while not navigator.is_task_complete():
        count += 1
        feedback = navigator.get_feedback()
        if feedback and count % 5 == 0:
            navigator.show(feedback)


def recover(navigator):
    assert navigator.battery_level(timeout=3) > 0.2, "the battery is low"
    navigator.back_up()


if __name__ == "__main__":
    main()
