"""Factors that bring the laboratory nearer to P1's: a full factorial design over the localiser, the lid and the camera.

`lab-robustness` crosses the factors on whole loops, and `lab-sensitivity` on a shorter mission.
"""
