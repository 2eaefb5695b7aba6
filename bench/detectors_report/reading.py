"""What the tables count, for whoever reads them: written into the document beside them."""

HOW_TO_READ = """\
### How it is measured

*Hits.* A vehicle cruises in trimmed flight, nose anywhere, into a wall square to its path, at a slant of up to 60° or
leaning by up to 45°, into a ceiling (climbing at 30° or more, at up to the airframe's 3 m/s; tilted by up to 10°) or,
anywhere across its width, into a pole of 2 to 30 cm radius. Speeds are drawn from 0.5 to 5 m/s, one in sixteen from
0.3 to 0.5. Friction is 0.3, the spread of an IMU sample 0.25 m/s² on each axis, the noise of the vehicle's velocity
0.032 m/s RMS on each axis, where a table does not say otherwise. Each hit is simulated once and heard on three links,
which ask for `HIGHRES_IMU` at 50, 100 and 250 Hz and receive what PX4's rule sends and its late loops leave (50, 100
and 246 Hz); everything else comes at the rates that the companion asks for. Every detector hears the same samples,
with its default settings.

Where a vehicle slips past a pole, the pole is put nearer to its middle.

*Over a bad link* each packet waits up to 10 ms more, 1 % are lost and 1 % are overtaken (20 ms later): other hits of
the same kinds, heard so. *Struck in hover*: the vehicle holds its place and the same obstacles come at it at 0.5 to 3
m/s and do not stop. *In a person's hand*: the vehicle hovers (drifting at up to 0.1 m/s) and is held where it is (by
an arm of 100 to 400 N/m) or pushed level with 2 to 6 m/s² that rise within 0.08 to 0.2 s, for 0.4 to 1.5 s; a grip
that gives no force beyond the threshold is told as nothing. Any collision told before, meanwhile or within 0.5 s after
it counts against the detector.

*Told as a mere contact, too*: beside the collision, or instead of it, a touch was reported that is none; of a vehicle
struck softly the collision is then often a later touch of the same obstacle. The bars for a struck hover and for a bad
link are those for hits in flight.

*Found*: a collision is reported within 0.4 s of the first touch. A touch that is classed as a landing or a hand is
not a collision. *False before*: reports before the first touch.

*The first sample that shows it*: the first received sample whose averaging window holds the obstacle's force, by the
simulator's truth, at a mean of more than six standard deviations of the sample's noise: of the 2.7 · 10⁷ numbers of
ten hours of samples noise alone takes one beyond that with a probability of 0.05. Where no received sample does, the
hit *fell between the samples*. Latency counts from the first touch.

*v_c error*: the estimated speed just before the hit less the true one; as a vector: the length of the difference.
*Normal error*: between the estimated normal, when the contact is over, and the normal of the surface where it was
touched first.

*Healthy flights*: from the ground to the ground, 100 s of dashes at up to 8 m/s, jumps, stops from full speed,
slaloms, spins and flips in between, calm or with gusts, turbulence, vibration up to a bent propeller's, a payload
dropped, a weak battery, estimator resets, free fall or a motor that fails (until a second after it did). Detectors
are off in take-off only. *Touches told as such*: reports that are no collisions.

*Recorded flights* are PX4 logs of other people's vehicles: four without a collision, ordinary landings included, and
one that strikes the ground. *Semi-synthetic* hits are recorded impacts (drops of a 0.24 kg quadrotor on concrete,
±200 g at 1 kHz) put into recorded flights, away from commanded descents to the ground: turned to come from any side,
added to what the flight's accelerometer showed, each axis of each millisecond clipped at ±16 g, averaged over the
flight's own integration intervals of 5 ms. The flight's velocity takes what its accelerometer showed of the impact,
as PX4's estimator would; its gyroscope shows nothing of it. *False before*: in the five seconds before the hit, which
are all that the detector has heard of the flight; `fused` waits for the first of them. Of the log that strikes the
ground only the strike itself is judged: it tumbles over the ground from 0.4 s before it until 0.1 s after.

*Threshold sweeps* (the picture of false alarms against detection rate): every detector again with its thresholds
times 1/4 to 4, on a share of the hits and flights.
"""
