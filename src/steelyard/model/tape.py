"""The index tape: integers that tell fixed kernels what one scene holds.

``tape[H_...]`` are the header fields below: counts, first rows of arrays in the scratch, and places on the
tape where sections start. A section starts with its count, then one record of fixed width per entry. All
indices are rows of the scratch of shape (rows, LANES), so a kernel fetches a particle's position, an anchor
or a parameter in the same way. A count of zero is a loop of no trips.
"""

from __future__ import annotations

(
    H_PARTICLES,
    H_STATE_ROWS,
    H_POSITION,
    H_VELOCITY,
    H_INVERSE_MASS,
    H_ACCELERATION,
    H_DAMPING,
    H_DAMPED,
    H_FORCE,
    H_FORCED,
    H_START,
    H_FREE,
    H_IMPULSE,
    H_UNSETTLED,
    H_GIVEN_UP,
    H_NONFINITE,
    H_TIME,
    H_DT,
    H_HASTY,
    H_BLOCKS,
    H_ENDS,
    H_VALUES,
    H_CONTACTS_MOST,
    H_RECIPE,
    H_SINGLES,
    H_REPEATS,
    H_PASSES,
    H_TOLERANCE,
    H_CONSTRAINED,
    H_CABLES,
    H_DRIFT,
    H_STIFF_SPRINGS,
    H_SPRINGS,
    H_GRAVITIES,
    H_BUOYANCIES,
    H_DRAGS,
    H_USER_FORCES,
    H_WINCHES,
    H_LINKS,
    H_MOVERS,
    H_RIDERS,
    H_CLUSTERS,
    H_CONTACTS,
    H_GENERATORS,
    H_MATRIX,
    H_MATRIX_ROWS,
    H_LINK_DIAGONALS,
    H_LINK_COUPLINGS,
    H_POINT_DIAGONALS,
    H_POINT_LINKS,
    H_POINT_POINTS,
    H_WRENCHES,
    H_WRENCH_PRODUCTS,
    H_REFERENCES,
    H_LINK_MASKS,
    H_PADDING,
    H_FACTOR,
    H_FORWARD,
    H_BACKWARD,
    H_CONTACT_COPIES,
    H_CONTACT_FACTOR,
    H_CONTACT_FORWARD,
    H_CONTACT_BACKWARD,
    H_CONTACT_PRODUCTS,
    H_DENSE,
    H_TOTAL,
    H_MOVES,
    H_RIGHT,
    H_GUESS,
    H_MASK,
    H_USED_MASK,
    H_WORK,
    H_ACTIVE,
    H_REACH,
    H_MASS,
    H_UNKNOWNS,
    H_SPRING_BLOCKS,
    H_DRAG_BLOCKS,
    H_FLOAT_BLOCKS,
    H_PROPAGATORS,
    H_SUBSTEPS,
    H_CONSTANTS,
    H_FILTERED,
    H_MARK,
    H_JOLT,
    H_SADDLE_SOLVE,
    H_SADDLE_LINKS,
    H_SADDLE_RIDERS,
    H_DIVISIONS,
    H_COMPLIANCES,
    H_IMPACTS,
    H_EVENTS,
    H_PARTS,
    H_KEPT,
    H_TRIAL,
    H_DAMPING_RATES,
    H_KINKS,
    H_BODIES,
    H_BODIES_DAMPED,
    H_ROTOR,
    H_POINTS,
    H_WRENCHED,
    H_APPLIED,
    H_THRUSTS,
    H_SURFACES,
    H_EXPLOSIONS,
    H_NOW,
    H_SOLIDS,
    H_COLLIDERS,
    H_PAIRS,
    H_MEETINGS,
    H_PARTINGS,
    H_JOINTS,
    H_WAKERS,
    H_RIGID,
) = range(115)
HEADER = 115

# Width of the records of links, contacts and springs that a solver holds; written field by field.
LINK = 17
CONTACT = 24
SADDLE_LINK = 10
COMPLIANCE = 10
# Records of a movable body: rows of position, orientation, velocity, angular momentum, wrench, inverse mass, inertia,
# its inverse, acceleration, damping, work rows, and of a body with a pivot its mass and the arm of that, else -1; and
# of a point of a body and a wrench (``forces.body_points``).
BODY, BODY_POINT, WRENCHED = 13, 9, 5
# Record of a substep of a composition: its length, what damping keeps of particles, growth of impulses, and what it
# keeps of bodies.
SUBSTEP = 4
# Work rows of a contact or cable whose impact is resolved inside the step.
EVENT = 15
# Record of a kink whose time is resolved: its kind, the row of what moves, the other end's and the length's, or the
# surface's and the half depth's; and its work rows.
KINK, KINK_ROWS = 4, 3
BUNGEE, FLOAT_TOP, FLOAT_BOTTOM = range(3)

# Records of clusters and of loads on them: what comes before their lists, and an entry of a cluster's. Work rows of a
# cluster: inertia, inverse of that with loads, turn (angular velocity in the velocity stage), shift of the centre
# by loads at the start and at the end, centre, mean motion and moment without impulses, mean motion, arms; of a load:
# its arm, r0 and r1 of the moment's equation, motion over the deck.
CLUSTER_HEAD, ENTRY, LOAD_HEAD = 11, 4, 5
INERTIA, INVERSE, TURN, SHIFT, CENTRE, DELTA, BASE, MEAN, ARMS = 0, 6, 12, 15, 18, 21, 24, 30, 33
ARM, BEFORE, AFTER, MOTION, LOAD_ROWS = 0, 3, 6, 9, 12

# Words behind the flags of blocks in ``skip``, from H_BLOCKS on: whether the factor and the forces at hand are not of
# the step's start, whether worlds in which a contact slips or opens are to be given up, whether events divided the last
# step, and how many lanes hold a world.
FRESH, HASTY, DIVIDED, COUNT, WORDS = range(5)

# Codes of contact geometries.
GROUND, LINE, USER, BALLS = range(4)
