"""The preflight survey as a step function: bytes and the time in, bytes out."""

from companion.mavlink.decode import Decoder
from companion.mavlink.encode import Encoder
from companion.messages import SetParameter
from companion.mission.config import CompanionConfig
from companion.preflight.checks import Finding, findings
from companion.preflight.survey import Survey, advance, start_survey


class Preflight:
    """Joins the codec with the pure survey; holds no clock and no socket. Times are microseconds, any epoch."""

    def __init__(self, config: CompanionConfig, now_us: int) -> None:
        self._decoder, self._encoder = Decoder(), Encoder()
        self.survey: Survey = start_survey(config, now_us)

    def step(self, received: bytes, now_us: int) -> tuple[bytes, ...]:
        """Call with what was received since the last call; what is to be sent."""
        survey = self.survey
        samples = [sample for _, sample in self._decoder.feed(received) if sample is not None]
        is_known = survey.identity is not None
        outgoing = advance(survey, samples, now_us)
        if survey.identity is not None and not is_known:
            self._decoder.listen_to(survey.identity.system_id, survey.identity.component_id)
            self._encoder.speak_to(survey.identity.system_id, survey.identity.component_id)
        return tuple(packet for message in outgoing for packet in self._encoder.packets(message))

    def set_parameter(self, name: str, value: int | float, now_us: int) -> tuple[bytes, ...]:
        """What sets it; `parameter` shows the vehicle's answer after further steps."""
        self.survey.parameters.pop(name, None)
        return (self._encoder.encode(SetParameter(name, value)), *self.step(b"", now_us))

    def parameter(self, name: str) -> int | float | None:
        """As the vehicle last told it."""
        return self.survey.parameters.get(name)

    @property
    def finished(self) -> bool:
        return self.survey.finished

    def findings(self) -> list[Finding]:
        """All items; complete once `finished` without a refusal."""
        return findings(self.survey)
