"""Where the numbers of rigid contact stand: on the tape, and in the work area of the one world at hand.

Contacts of bodies differ from world to world in number and place, so they are found and solved world by world: each
is gathered from its lane into the work area, flat in the scratch, and scattered back.
"""

from __future__ import annotations

# Words of the record that ``tape[H_RIGID]`` points to: counts, places on the tape, flat entries of the work area, rows
# of the state, addresses and places in the integers.
(
    SOLIDS, SOLID_RECORDS, COLLIDERS, COLLIDER_RECORDS, PAIRS, PAIR_RECORDS, NUMBERS, STORED_ROW, CAPACITY,
    OVERFLOW_ROW, START_ROW, SOLID_WORK, PLACED_WORK, CONTACT_WORK, POINTS_WORK, NARROW_WORK, MATRIX_ROW, HELD_ROW,
    VECTOR_ROW, JOINTS, JOINT_RECORDS, ROW_WORK, FRAME_WORK, BOUND_ROW, PACK_ROW, REST_ROW, WAKERS, WAKER_RECORDS,
    SOLVE, PLANES, GROUPS, MEETING_RECORDS, PARTING_RECORDS, PARTINGS, BOXES, STORED,
    DEGREES, ADJACENT, ORDER, LOCAL, FIRST, STARTS, END_A, END_B, LIST, MATCHED, HELD, ISLAND, TREES, NEAR, RIGID_WORDS,
) = range(51)  # fmt: skip

# The island at hand: numbers of solids, contacts, joints and the factor's rows, and whether the solve settled.
SETTLED, ISLAND_ENTRIES = 4, 5

# Record of a solid (body or particle): rows of position, orientation, velocity, angular momentum, inverse mass, inertia
# and its inverse, -1 where it has none; whether it moves (1), turns (2), and looks
# other when it has turned (4); rows of its constant acceleration.
SOLID = 9
# Record of a collider: kind, solid or -1, its number, rows of a ground's plane or of a particle's radius, its group.
COLLIDER = 5
# Record of a pair, where a scene lists them all: colliders a and b, of which a can move.
PAIR = 2
# Record of how a group meets another: rows of restitution and friction, and of that of spinning and rolling, or -1.
MEETING = 4
# Record of a joint: locked coordinates as bits, solids a and b (or -1: the world), its numbers, first of its rows and
# how many, state rows of whether it is broken, of its force and of its torque, rows of the force and torque that break
# it and of its length, number of drives; and of each drive: coordinate, rows of speed, strength, limits, stiffness,
# damping and rest.
JOINT, DRIVE = 29, 8
JOINT_BROKEN, JOINT_TORN, JOINT_LENGTH, JOINT_DRIVES, DRIVES_AT = 6, 9, 11, 12, 13

# Settings, first of the numbers; then of every collider the place in its solid (3), turn (9), sizes (3), and the radius
# of a ball about its centre that holds it.
(
    N_COMPLIANCE, N_TOLERANCE, N_IMPULSE, N_SHIFT, N_SLOP, N_PASSES, N_ITERATIONS, N_REST_SPEED, N_REST_TIME,
    N_SWEEPS, N_WORST, N_HERTZ, N_RATIO, SETTINGS,
) = range(14)  # fmt: skip
GEOMETRY = 16
G_PLACE, G_TURN, G_SIZE, G_REACH = 0, 3, 12, 15

# Work of a solid: place, mass and its inverse, whether it moves and turns, rotation (9), inertia and its inverse in the
# world's axes (6 each: xx, yx, yy, zx, zy, zz), and six-vectors: velocity without contacts, velocity, Newton's step,
# gradient, momentum against the first, and mass times the step.
S_PLACE, S_MASS, S_INVERSE, S_MOVES, S_TURNS, S_ROTATION, S_INERTIA, S_INVERSE_INERTIA = (
    0,
    3,
    4,
    5,
    6,
    8,
    17,
    24,
)
S_FREE, S_VELOCITY, S_STEP, S_GRADIENT, S_MOMENTUM, S_PUSH = 32, 40, 48, 56, 64, 72
# Place and rotation at the end of the step, and orientation there; geometric stiffness times the step (6, as inertia)
# and the rotation midway (9); impulses so far, those of joints among them, and those after the first solve.
S_END, S_END_ROTATION, S_TURN, S_GEOMETRIC, S_MIDDLE, S_BASE, S_JOINED, S_KEPT = (
    80,
    84,
    96,
    100,
    106,
    116,
    122,
    128,
)
SOLID_ENTRIES = 136

# Work of a contact: what the narrow phase writes (normal from b to a, gap, place, id), two tangents, arms, friction,
# restitution, compliance, least normal velocity, impulses of the last pass and of this one along normal and tangents,
# velocity and its change, shift of the normal velocity by friction, rebound, the derivative of the impulse, mobility,
# normal impulse that is there already, whether it was known before,
# and if it was only found where the step ends, one more than its pair may be deep there, below 0 before it is solved;
# of friction of spinning and rolling the lengths, the normal impulse that limits it, impulses of the last pass and of
# this one about normal and tangents, angular velocity (in sweeps: mobilities) and its change, and mobility; and whether
# the solve before changed the impulses of its island.
C_NORMAL, C_GAP, C_PLACE, C_ID, C_TANGENT, C_BINORMAL, C_ARM_A, C_ARM_B = 0, 3, 4, 7, 8, 11, 14, 17
C_FRICTION, C_RESTITUTION, C_COMPLIANCE, C_LEAST, C_BEFORE, C_IMPULSE = 20, 21, 22, 23, 24, 27
C_SPEED, C_CHANGE = 30, 33
C_SHIFT, C_REBOUND, C_DERIVATIVE, C_WEIGHT, C_HELD, C_EARLIER, C_LATE = 36, 37, 38, 44, 45, 46, 47
C_SPINNING, C_ROLLING, C_LIMIT, C_BRAKE_BEFORE, C_BRAKE, C_BRAKE_SPEED, C_BRAKE_CHANGE = (
    48,
    49,
    50,
    51,
    54,
    57,
    60,
)
C_BRAKE_WEIGHT, C_MOVED = 63, 64
CONTACT_ENTRIES = 65

# Numbers of a joint's end: place and axes in its solid. Entries of a row of a joint: direction of its force, of its
# torques on a and b, wanted velocity, compliance, impulse of the last pass and of this one, bounds of it, velocity and
# its change, error, kind, mobility, stiffness and damping of a spring, what the passes before asked for and left, the
# impulse of the first solve, and that which the base holds already.
JOINT_NUMBERS = 24
#: Frames of both ends, and behind them the sums from which passes are mixed.
FRAME_ENTRIES = 56
J_FORCE, J_TORQUE_A, J_TORQUE_B, J_LEAST, J_COMPLIANCE, J_BEFORE, J_IMPULSE = (
    0,
    3,
    32,
    35,
    36,
    37,
    38,
)
J_LOW, J_HIGH = 39, 40
J_SPEED, J_CHANGE, J_ERROR, J_KIND, J_WEIGHT, J_STIFFNESS, J_DAMPING = 41, 42, 43, 44, 45, 46, 47
#: Passes of which rows remember what they asked for and left.
REMEMBERED = 5
J_ASKED, J_LEFT = 48, 48 + REMEMBERED
J_KEPT, J_OFFSET = 58, 59
# Of sweeps: the inverse mobility; and if this row and the next two are solved together the inverse of theirs (six
# numbers, the first of them 0 if not).
J_STEP, J_BLOCK, ROW_ENTRIES = 60, 61, 72
#: Rows of a drive: two limits, motor, spring.
DRIVE_ROWS = 4
OFF, EQUAL, LIMIT, MOTOR, SPRING = 0.0, 1.0, 2.0, 3.0, 4.0

# A wide row (``constraints.wide_rows``), four times eight entries: its direction for solids a and b, and both times the
# inverse of mass and inertia.
W_B, W_MOVES_A, W_MOVES_B, WIDE_ROW = 8, 16, 24, 32

# Rows of the state per contact: its id + 1, or 0 for none; impulse and place in the world; rebound; and the normal
# impulse of the position stage on what was open, on which the velocity stage has friction; in scenes with friction of
# spinning or rolling its impulse in the world too.
STORED_USUALLY, STORED_WITH_BRAKES = 9, 12
T_ID, T_IMPULSE, T_PLACE, T_REBOUND, T_HELD, T_BRAKE = 0, 1, 4, 7, 8, 9

# Rows of the state per solid that may sleep (``solvers.sleep``), and behind them all one more, of what they share.
REST = 3
REST_KICK, REST_POSE = 1, 2
