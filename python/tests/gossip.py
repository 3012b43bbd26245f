"""An application for the tests: pilots that gossip, fail, and print."""

import os
import struct

import skein


class Gossip(skein.Pilot):
    """Says its x, hears that of the others, and flies to their mean."""

    def __init__(self, birth):
        self.k = birth.params.get("k", 0.5)
        if not isinstance(self.k, float):
            raise skein.ParamError("k", f"expected a number, found {self.k!r}")
        self.known = {}
        assert birth.scenario["formation"]["drones"] == birth.drones

    def step(self, senses, inbox, out):
        for message in inbox.of("gossip"):
            (self.known[message.source],) = struct.unpack("<d", message.data)
        x = senses.position_m[0]
        out.say("gossip", struct.pack("<d", x))
        out.metric("heard", len(self.known))
        near = senses.neighbours_array()
        assert len(near) == len(senses.neighbours)
        mean = sum(self.known.values()) / max(len(self.known), 1)
        up = float(near["position_m"][:, 2].sum()) if len(near) else 0.0
        return skein.Acceleration(self.k * (mean - x), 0.0, up)


class Fails(Gossip):
    """Makes a mistake after half a second."""

    def __init__(self, birth):
        super().__init__(birth)
        self.how = birth.params.get("how", "raise")

    def step(self, senses, inbox, out):
        if senses.now_s >= 0.5:
            if self.how == "raise":
                raise RuntimeError("no more")
            if self.how == "nan":
                return skein.Acceleration(float("nan"), 0.0)
            if self.how == "none":
                return None
            if self.how == "fork":
                self.how = "forked"
                os.fork()
            if self.how == "exit":
                os._exit(7)
        print("on stdout")
        return super().step(senses, inbox, out)


if __name__ == "__main__":
    skein.main(gossip=Gossip, fails=Fails)
