"""The link between vehicle and companion."""

from bench.faults.injectors import flying
from bench.fly.air import COMPLETED, HANDED_OVER, Expected, Fault
from sim_vehicle.bench.faults import corruption, delay, duplication, link_cut, packet_loss, reordering

# Half of the contact may be lost with the packets; what is not seen can only be found by what it left.
_MAY_MISS = Expected(finds=False)
# A link that is gone for seconds may end the flight: the vehicle holds by itself.
_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)

_LOST = "lost, both ways, from the cruise on"
_GONE = "nothing gets through for"
_ONE_WAY = "for 2 s the {} hears nothing; what it sends arrives"

FAULTS = (
    Fault("loss 10 %", f"one packet of ten {_LOST}", flying(packet_loss(0.1))),
    Fault("loss 30 %", f"three packets of ten {_LOST}", flying(packet_loss(0.3)), _MAY_MISS),
    Fault(
        "burst loss",
        "15 % lost in runs of 10, both ways, from the cruise on",
        flying(packet_loss(0.15, 10.0)),
        _MAY_MISS,
    ),
    Fault("reorder", "20 % of packets held back by 20 ms and overtaken", flying(reordering(0.2))),
    Fault("duplicate", "30 % of packets come twice", flying(duplication(0.3))),
    Fault("delay 100 ms", "every packet 100 ms later, each way", flying(delay(0.1))),
    Fault("jitter 50 ms", "every packet up to 50 ms later, each way", flying(delay(0.0, 0.05))),
    Fault("bit errors", "one byte changed in 5 % of packets", flying(corruption(0.05))),
    Fault("cut 0.5 s", f"{_GONE} 0.5 s, around the hit", flying(link_cut(), 0.5), _MAY_MISS),
    Fault("cut 3 s", f"{_GONE} 3 s, in the cruise or the recovery", flying(link_cut(), 3.0), _MAY_END),
    Fault("cut to the companion", _ONE_WAY.format("companion"), flying(link_cut("to_companion"), 2.0), _MAY_END),
    Fault("cut to the vehicle", _ONE_WAY.format("vehicle"), flying(link_cut("to_vehicle"), 2.0), _MAY_END),
)
