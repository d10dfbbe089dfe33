"""Where the numbers of rigid contact stand: on the tape, and in the work area of the one world at hand.

Contacts of bodies differ from world to world in number and place, so they are found and solved world by world: each
is gathered from its lane into the work area, flat in the scratch, and scattered back.
"""

from __future__ import annotations

# Words of the record that ``tape[H_RIGID]`` points to: counts, places on the tape, flat entries of the work area, rows
# of the state, addresses and places in the integers.
(
    SOLIDS, SOLID_RECORDS, COLLIDERS, COLLIDER_RECORDS, PAIRS, PAIR_RECORDS, NUMBERS, STORED_ROW, CAPACITY,
    OVERFLOW_ROW, START_ROW, SOLID_WORK, PLACED_WORK, CONTACT_WORK, POINTS_WORK, NARROW_WORK, MATRIX_ROW, VECTOR_ROW,
    DEGREES, ADJACENT, ORDER, LOCAL, FIRST, STARTS, END_A, END_B, LIST, MATCHED, RIGID_WORDS,
) = range(29)  # fmt: skip

# Record of a solid (body or particle): rows of position, orientation, velocity, angular momentum, inverse mass, inertia
# and its inverse, -1 where it has none; whether it moves (1) and turns (2).
SOLID = 8
# Record of a collider: kind, solid or -1, its number, and rows of a ground's plane or of a particle's radius.
COLLIDER = 4
# Record of a pair: colliders a and b, of which a can move; rows of restitution and friction.
PAIR = 4

# Settings, first of the numbers; then of every collider the place in its solid (3), turn (9), sizes (3), and the radius
# of a ball about its centre that holds it.
(
    N_COMPLIANCE, N_TOLERANCE, N_IMPULSE, N_SHIFT, N_SLOP, N_PASSES, N_ITERATIONS, SETTINGS,
) = range(8)  # fmt: skip
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
SOLID_ENTRIES = 80

# Work of a contact: what the narrow phase writes (normal from b to a, gap, place, id), two tangents, arms, friction,
# restitution, compliance, least normal velocity, impulses of the last pass and of this one along normal and tangents,
# velocity and its change, shift of the normal velocity by friction, rebound, and the derivative of the impulse.
C_NORMAL, C_GAP, C_PLACE, C_ID, C_TANGENT, C_BINORMAL, C_ARM_A, C_ARM_B = 0, 3, 4, 7, 8, 11, 14, 17
C_FRICTION, C_RESTITUTION, C_COMPLIANCE, C_LEAST, C_BEFORE, C_IMPULSE = 20, 21, 22, 23, 24, 27
C_SPEED, C_CHANGE = 30, 33
C_SHIFT, C_REBOUND, C_DERIVATIVE, C_WEIGHT, C_CLOSED, C_EARLIER = 36, 37, 38, 44, 45, 46
CONTACT_ENTRIES = 48

# Rows of the state per contact: its id + 1, or 0 for none; impulse and place in the world; rebound.
STORED = 8
T_ID, T_IMPULSE, T_PLACE, T_REBOUND = 0, 1, 4, 7
