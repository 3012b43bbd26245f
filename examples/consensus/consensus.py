"""Average consensus over the radio: every drone ends up with the mean of all start values.

Each drone broadcasts its value once per tick and moves it towards the values that it hears
(Olfati-Saber, Fax and Murray, Proceedings of the IEEE 95 (2007), 215-233)."""

import struct

import skein


class Agent(skein.Pilot):
    def __init__(self, birth):
        self.gain = birth.params.get("gain", 0.05)
        self.value = float(birth.drone)
        self.quiet = 0

    def step(self, senses, inbox, out):
        heard = [struct.unpack("<d", message.data)[0] for message in inbox.of("gossip")]
        change = self.gain * sum(value - self.value for value in heard)
        self.value += change
        self.quiet = self.quiet + 1 if heard and abs(change) < 1e-4 else 0
        out.say("gossip", struct.pack("<d", self.value))
        out.metric("value", self.value)
        out.done(self.quiet >= 50)
        return skein.Velocity(0.0, 0.0, 0.0)


if __name__ == "__main__":
    skein.main(consensus=Agent)
