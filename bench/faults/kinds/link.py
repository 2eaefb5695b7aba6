"""The link between vehicle and companion."""

from bench.faults.air import When
from bench.faults.fault import COMPLETED, HANDED_OVER, Expected, Fault
from bench.faults.injectors import Simulated
from sim_vehicle.bench.faults import corruption, delay, duplication, link_cut, packet_loss, reordering

# Half of the contact may be lost with the packets; what is not seen can only be found by what it left.
_MAY_MISS = Expected(finds=False)
# A link that is gone for seconds may end the flight: the vehicle holds by itself.
_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)

FAULTS = (
    Fault(
        "loss 10 %",
        "link",
        "one packet of ten lost, both ways, from the cruise on",
        lambda c: Simulated(packet_loss(0.1), When.flying(c)),
    ),
    Fault(
        "loss 30 %",
        "link",
        "three packets of ten lost, both ways, from the cruise on",
        lambda c: Simulated(packet_loss(0.3), When.flying(c)),
        _MAY_MISS,
    ),
    Fault(
        "burst loss",
        "link",
        "15 % lost in runs of 10, both ways, from the cruise on",
        lambda c: Simulated(packet_loss(0.15, 10.0), When.flying(c)),
        _MAY_MISS,
    ),
    Fault(
        "reorder",
        "link",
        "20 % of packets held back by 20 ms and overtaken",
        lambda c: Simulated(reordering(0.2), When.flying(c)),
    ),
    Fault("duplicate", "link", "30 % of packets come twice", lambda c: Simulated(duplication(0.3), When.flying(c))),
    Fault(
        "delay 100 ms", "link", "every packet 100 ms later, each way", lambda c: Simulated(delay(0.1), When.flying(c))
    ),
    Fault(
        "jitter 50 ms",
        "link",
        "every packet up to 50 ms later, each way",
        lambda c: Simulated(delay(0.0, 0.05), When.flying(c)),
    ),
    Fault(
        "bit errors",
        "link",
        "one byte changed in 5 % of packets",
        lambda c: Simulated(corruption(0.05), When.flying(c)),
    ),
    Fault(
        "cut 0.5 s",
        "link",
        "nothing gets through for 0.5 s, around the hit",
        lambda c: Simulated(link_cut(), When.flying(c, 0.5)),
        _MAY_MISS,
    ),
    Fault(
        "cut 3 s",
        "link",
        "nothing gets through for 3 s, in the cruise or the recovery",
        lambda c: Simulated(link_cut(), When.flying(c, 3.0)),
        _MAY_END,
    ),
    Fault(
        "cut to the companion",
        "link",
        "for 2 s the companion hears nothing; what it sends arrives",
        lambda c: Simulated(link_cut("to_companion"), When.flying(c, 2.0)),
        _MAY_END,
    ),
    Fault(
        "cut to the vehicle",
        "link",
        "for 2 s the vehicle hears nothing; what it sends arrives",
        lambda c: Simulated(link_cut("to_vehicle"), When.flying(c, 2.0)),
        _MAY_END,
    ),
)
