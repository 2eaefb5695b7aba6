"""MAVLink's numbers as they stand in .plan files: MAV_CMD and MAV_FRAME."""

WAYPOINT = 16
LOITER_TURNS = 18
LOITER_TIME = 19
RETURN_TO_LAUNCH = 20
LAND = 21
TAKEOFF = 22
DELAY = 93
CONDITION_DELAY = 112
CONDITION_YAW = 115
JUMP = 177
CHANGE_SPEED = 178

# Cameras, gimbals and regions of interest: they do not change where the vehicle flies.
BESIDE_THE_WAY = frozenset(
    {195, 196, 197, 200, 201, 203, 204, 205, 206, 214, 530, 531, 532, 1000, 2000, 2001, 2500, 2501}
)

# MAV_TYPE: what QGroundControl writes for any multicopter is a quadrotor.
QUADROTOR = 2
MULTICOPTERS = frozenset({QUADROTOR, 3, 4, 13, 14, 15, 29, 35, 43})

FRAME_ABOVE_SEA = (0, 5)
FRAME_ABOVE_HOME = (3, 6)
FRAME_WITHOUT_PLACE = 2
