"""The bully election (Garcia-Molina, IEEE Transactions on Computers C-31 (1982), 48-59) over the radio of Skein."""

import struct

import skein

ELECTION, OK, COORDINATOR = range(3)


class Bully(skein.Pilot):
    def __init__(self, birth):
        self.me = birth.drone
        self.timeout = birth.params.get("timeout_s", 1.0)
        self.answer = birth.params.get("answer_s", 0.3)
        self.leader = None
        self.heard_at = None
        self.asked_at = None
        self.answered = False

    def step(self, senses, inbox, out):
        now = senses.now_s
        if self.heard_at is None:
            self.heard_at = now
        for message in inbox.of("bully"):
            self.hear(now, *struct.unpack("<BI", message.data), out)
        if self.leader == self.me:
            if round(now / 0.02) % 10 == 0:
                self.say(out, COORDINATOR)
        elif self.asked_at is not None and not self.answered and now - self.asked_at > self.answer:
            self.leader, self.asked_at = self.me, None
            self.say(out, COORDINATOR)
        elif now - self.heard_at > self.timeout and (self.asked_at is None or now - self.asked_at > self.timeout):
            self.ask(now, out)
        out.metric("leader", -1.0 if self.leader is None else float(self.leader))
        out.metric("leads", float(self.leader == self.me))
        return skein.Velocity(0.0, 0.0, 0.0)

    def hear(self, now, kind, source, out):
        if kind == ELECTION and source < self.me:
            self.say(out, OK)
            if self.leader != self.me and self.asked_at is None:
                self.ask(now, out)
        elif kind == OK and source > self.me:
            self.answered = True
        elif kind == COORDINATOR:
            if source >= self.me:
                self.leader, self.heard_at, self.asked_at = source, now, None
            elif self.leader != self.me and self.asked_at is None:
                self.ask(now, out)

    def ask(self, now, out):
        self.asked_at, self.answered, self.leader = now, False, None
        self.say(out, ELECTION)

    def say(self, out, kind):
        out.say("bully", struct.pack("<BI", kind, self.me))


if __name__ == "__main__":
    skein.main(bully=Bully)
