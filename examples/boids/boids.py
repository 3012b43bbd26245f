"""Reynolds' boids ("Flocks, herds, and schools", SIGGRAPH 1987): the same law as in `src/main.rs`, in Python.

    python boids.py run field.toml
"""

import math

import skein


class Boid(skein.Pilot):
    """A drone that keeps apart from near neighbours, flies as they do, and stays with them."""

    def __init__(self, birth):
        get = birth.params.get
        self.separation, self.alignment = get("separation", 60.0), get("alignment", 0.5)
        self.cohesion, self.apart_m, self.speed_mps = get("cohesion", 0.05), get("apart_m", 20.0), get("speed_mps", 5.0)
        if not self.apart_m > 0:
            raise skein.ParamError("apart_m", f"expected a distance above 0, found {self.apart_m}")

    def step(self, senses, inbox, out):
        vx, vy, vz = senses.velocity_mps
        ax, ay, az = self.speed_mps - vx, -vy, -vz
        neighbours = senses.neighbours
        count = max(len(neighbours), 1)
        for neighbour in neighbours:
            (x, y, z), (u, v, w) = neighbour.position_m, neighbour.velocity_mps
            d = math.sqrt(x * x + y * y + z * z)
            near = self.separation / max(d * d, 1.0) / d if d < self.apart_m else 0.0
            pull, align = self.cohesion / count - near, self.alignment / count
            ax, ay, az = ax + align * u + pull * x, ay + align * v + pull * y, az + align * w + pull * z
        for obstacle in senses.obstacles:
            x, y, z = (here - there for here, there in zip(senses.position_m, obstacle.nearest_m))
            push = self.separation / max(x * x + y * y + z * z, 1.0)
            ax, ay, az = ax + push * x, ay + push * y, az + push * z
        out.metric("neighbours", count)
        return skein.Acceleration(ax, ay, az)


if __name__ == "__main__":
    skein.main(boids=Boid)
