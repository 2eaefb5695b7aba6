"""What the tables count, for whoever reads them: written into the document beside them."""

HOW_TO_READ = """\
### How it is measured

*A random mission* follows from its seed, which is also the seed of the simulated vehicle; both airframes fly the
same. Rooms: four walls around the vehicle (every second one with a ceiling; in two of five the fence is the room,
0.3 m in), walls that stand free at any angle or lean, corners of 60 to 130°, corridors of 2 to 4.5 m, poles of 2
to 30 cm radius, boxes; poles and ceilings come on top in others, now and then a beam over the start or a box that
comes and goes. Wind up to 5 m/s, two of five with a gust. One to three ways (`go_to`, `velocity`, `path`, `orbit`,
straight up) at 0.5 to 4 m/s, two thirds of them into something, holds, turns, waits and repeats in between, any
policy for the mission and for some items, the end a `land` or a `return`. `HIGHRES_IMU` comes with 200 Hz (PX4's
`IMU_INTEG_RATE` on a flight controller) or with 50 Hz (its default stream); everything else is the default.

*Ended as it says*: no crash; every hit of 0.5 m/s and more into a surface noticed, and none answered that was
none; after each recovery what the policy says, at its limit what follows that, and after a goal out of reach what
the mission says of that; every way that nothing interrupted ended within 0.75 m of its goal, holds within 0.5 m,
landings within 1 m of where they were told and of home; no way to a goal or home led into a place (0.3 m) that an
earlier hit had shown, but a second try of the same item; no goal was called out of reach to which the straight way
is 1.5 m clear of everything; the outcome that follows. *Crash*: leant by more than 90°, reached the ground with
more than 1.2 m/s or when nothing said to land, more than 1 m outside the fence. All by what really happened, and
by the rules of `docs/how-to/missions.md`, not by the companion's own state. A vehicle that leant beyond 90° or
touched the ground, rose again and finished its mission has crashed all the same.

*Hits* count by their first contact; its speed is that against the obstacle. *Noticed*: of hits that went into the
surface with 0.5 m/s and more. *Past*: beyond the recovery setpoint told last, in the direction in which it lies from
the contact. *Again*: another contact with the same surface before the vehicle had recovered; *had come back* where the
centre had, and was not still on its way in, from one guard to the next, less than 0.1 s after the first. *Other
surface*: one with something else. *Clear*: how much further from what was touched than at the touch, the nearest in
the last half second of the recovery.
*Height*, lost or gained against the contact's: of level flights (0.3 m/s) into something upright that met nothing
else. *The feed-forward of the height* is an acceleration that brakes a climb or a fall after a hit; every fifth
mission is flown again without it (`recovery: {vertical_acceleration_m_s2: 0}`), and first hits are compared, which
up to then are the same.

*The laws* fly the same hits on a wall, square and at 30°, at 1, 2, 3, 4 and 5 m/s; [recovery.md](recovery.md) has
their table.
"""
