"""Replay of the scheduler on 1 to 1024 ranks with the measured costs of the points of figure 9.

Measures the cost of every point on one rank, spreads the costs to a map of 10^6 points, and replays
the program's own rule of handing out chunks (schedule.py): rigid twins first, then, when all are
there, the flexible points; of both a pilot, then what seems dearest. Writes replay.json and
the figures replay and replay_constants.
"""

import sys
from dataclasses import asdict, replace

import costs
import harness
import numpy as np
import schedule
from harness import style
from schedule import Machine

TOLERANCE = 1e-6
PHASES = ("rigid", "flexible")  # in their order
RANKS = tuple(2**k for k in range(11))
GRID, QUICK_GRID = {}, {"speed_count": 115, "stiffness_count": 19}
FINE, QUICK_FINE = (400, 2500), (40, 250)  # stiffnesses, speeds
SEED = 20180720

EFFICIENCY_LIMIT = 0.90  # on 1024 ranks, 10^6 points

# Constants that are tried out, and the numbers of ranks that they must suit.
LARGEST = tuple(2**k for k in range(3, 8))
PER_RANK = tuple(2**k for k in range(10))
TRIED_RANKS = (2, 32, 256, 1024)


def refined(tables, shape, random):
    """Costs on a finer grid over the same ranges: of a point, those of one of its measured neighbours.

    Drawn, the nearer one more often, and not averaged: averages would hide the dear points among cheap ones.
    """
    places = []
    for old, new in zip(tables.shape[1:], shape, strict=True):
        at = np.linspace(0.0, old - 1.0, new)
        below = np.clip(at.astype(int), 0, max(old - 2, 0))
        places.append((below, at - below))
    (row, row_part), (speed, speed_part) = places
    rows = row[:, None] + (random.random(shape) < row_part[:, None])
    columns = speed[None, :] + (random.random(shape) < speed_part[None, :])
    return tables[:, rows, columns]


class Map:
    """A map whose sweep is replayed."""

    def __init__(self, name, measured, machine):
        self.name, self.costs, self.machine = name, measured, machine
        self.sizes = {part: measured.least(part).size for part in PHASES}
        self.pieces = [
            schedule.pieces_of(
                dict(zip(measured.lengths[part], getattr(measured, part), strict=True)), machine.write
            )
            for part in PHASES
        ]
        self.known = {}

    def chunks(self, part, length):
        """Costs of the chunks of one phase, in order."""
        return schedule.cut(self.costs.at(part, length), length)

    def lengths(self, constants, ranks):
        """Points of a chunk in each phase."""
        return {part: constants.length(size, ranks) for part, size in self.sizes.items()}

    def phase(self, part, length, ranks):
        """Seconds of one phase with chunks of a length."""
        if (part, length, ranks) not in self.known:
            chunks = self.chunks(part, length)
            order = schedule.forecast(length, self.costs.least(part).shape)
            self.known[part, length, ranks] = schedule.replay(chunks, ranks, self.machine, order)
        return self.known[part, length, ranks]

    def seconds(self, constants, ranks):
        """Seconds of both phases: the second begins when all ranks have done the first."""
        # In between the rigid twins go to all ranks.
        gather = 2.0 * self.machine.latency * float(np.ceil(np.log2(ranks)))
        lengths = self.lengths(constants, ranks)
        rigid, flexible = (self.phase(part, lengths[part], ranks) for part in PHASES)
        return rigid + gather, flexible

    def bound(self, ranks):
        """No schedule is done earlier [s]: the work is shared evenly, but no point is divided."""
        return sum(schedule.lower_bound(self.costs.least(part), ranks) for part in PHASES)

    def tile_bounds(self, ranks):
        """No schedule of tiles is done earlier [s], even if it knew all costs and cut each tile best.

        Of one in which the flexible points wait for the rigid twins, as they do, and of one in which not.
        """
        waiting = sum(schedule.tile_bound([pieces], ranks) for pieces in self.pieces)
        return waiting, schedule.tile_bound(self.pieces, ranks)

    def of_bound(self, constants, ranks):
        """The least possible time over that of all ranks together; what is lost is lost to the schedule."""
        return self.bound(ranks) / sum(self.seconds(constants, ranks))

    def what_if(self, constants, ranks):
        """Efficiencies of other rules on so many ranks."""
        lengths = self.lengths(constants, ranks)
        rigid, flexible = (self.chunks(part, lengths[part]) for part in PHASES)
        singles = (self.chunks(part, 1) for part in PHASES)
        rules = {
            "softest support first": (rigid, flexible),
            "dearest chunk first, as if known before": tuple(np.sort(c)[::-1] for c in (rigid, flexible)),
            "dearest point first, chunks of one": tuple(np.sort(c)[::-1] for c in singles),
            "the same, flexible points do not wait for the rigid twins": (
                np.sort(np.concatenate([rigid, flexible]))[::-1],
            ),
        }
        one = sum(self.seconds(constants, 1))
        return {
            name: one / (ranks * sum(schedule.replay(phase, ranks, self.machine) for phase in phases))
            for name, phases in rules.items()
        }

    def report(self, constants, all_ranks):
        """The replay with the constants as they are."""
        alone = dict(zip(PHASES, self.seconds(constants, 1), strict=True))
        one = sum(alone.values())
        lines = []
        for ranks in all_ranks:
            rigid, flexible = self.seconds(constants, ranks)
            lengths = self.lengths(constants, ranks)
            chunks = self.chunks("flexible", lengths["flexible"])
            tiles, tiles_at_once = self.tile_bounds(ranks)
            lines.append(
                {
                    "ranks": ranks,
                    "chunk_length": lengths,
                    "tile": schedule.tile(lengths["flexible"], self.costs.flexible.shape[1:]),
                    "chunks": int(chunks.size),
                    "cost_of_small_chunks": float(chunks.sum()) / alone["flexible"],
                    "rigid_seconds": rigid,
                    "flexible_seconds": flexible,
                    "seconds": rigid + flexible,
                    "efficiency": one / (ranks * (rigid + flexible)),
                    "efficiency_of_the_flexible_points": alone["flexible"] / (ranks * flexible),
                    "best_efficiency_of_any_schedule": min(1.0, one / (ranks * self.bound(ranks))),
                    "best_efficiency_of_any_tiles": min(1.0, one / (ranks * tiles)),
                    "the_same_if_none_waits_for_the_twins": min(1.0, one / (ranks * tiles_at_once)),
                    "dearest_chunk_seconds": float(chunks.max()),
                    "seconds_per_rank_if_shared_evenly": float(chunks.sum()) / ranks,
                }
            )
        return {
            "points": sum(self.sizes.values()),
            "seconds_on_one_rank": one,
            "dearest_point_seconds": {part: float(self.costs.least(part).max()) for part in PHASES},
            "ranks": lines,
            "other_rules": {"ranks": all_ranks[-1], "efficiency": self.what_if(constants, all_ranks[-1])},
        }


def try_constants(maps, all_ranks, now):
    """How near to the best possible time other constants come; the best first: where it is least, most.

    `largest_chunk` up to the one for which costs were measured.
    """
    tried = []
    for largest in sorted({*LARGEST, now.largest_chunk}):
        for per_rank in sorted({*PER_RANK, now.chunks_per_rank}):
            constants = replace(now, largest_chunk=largest, chunks_per_rank=per_rank)
            each = {m.name: {n: m.of_bound(constants, n) for n in all_ranks} for m in maps}
            values = [value for by_ranks in each.values() for value in by_ranks.values()]
            tried.append(
                {**asdict(constants), "least": min(values), "mean": float(np.mean(values)), "of_bound": each}
            )
        print(f"constants: largest_chunk {largest} tried", flush=True)
    return sorted(tried, key=lambda t: (-round(t["least"], 3), -round(t["mean"], 3), -t["largest_chunk"]))


def plot_efficiency(reports, options):
    """Efficiency over ranks."""
    drawn, axes = harness.figure()
    looks = ((style.BLUE, "o"), (style.VERMILION, "s"))
    for (name, report), (colour, marker) in zip(reports.items(), looks, strict=True):
        ranks = [line["ranks"] for line in report["ranks"]]
        shown = [100.0 * line["efficiency"] for line in report["ranks"]]
        bound = [100.0 * line["best_efficiency_of_any_tiles"] for line in report["ranks"]]
        axes.plot(ranks, shown, marker=marker, color=colour, label=name)
        axes.plot(ranks, bound, ls=":", color=colour, label=f"{name}: no tiles are better")
    axes.axhline(100.0 * EFFICIENCY_LIMIT, color=style.GREY, ls="--", label="target on 1024 ranks")
    axes.set(xlabel="ranks [1]", ylabel="parallel efficiency, replayed [%]", xscale="log", ylim=(0.0, 105.0))
    axes.set_xscale("log", base=2)
    axes.set_xticks(RANKS[::2], [str(n) for n in RANKS[::2]])
    axes.legend(loc="lower left")
    harness.save(drawn, options, "replay")


def plot_constants(tried, now, options):
    """How near to the best possible time, over both constants."""
    drawn, axes = harness.figure()
    largest = sorted({t["largest_chunk"] for t in tried})
    per_rank = sorted({t["chunks_per_rank"] for t in tried})
    least = np.full((len(largest), len(per_rank)), np.nan)
    for t in tried:
        least[largest.index(t["largest_chunk"]), per_rank.index(t["chunks_per_rank"])] = 100.0 * t["least"]
    shown = axes.imshow(least, origin="lower", aspect="auto", vmin=0.0, vmax=100.0, cmap=style.SEQUENTIAL)
    here = per_rank.index(now.chunks_per_rank), largest.index(now.largest_chunk)
    axes.plot(*here, "x", color=style.VERMILION, ms=7, mew=1.5, label="as they are")
    best = per_rank.index(tried[0]["chunks_per_rank"]), largest.index(tried[0]["largest_chunk"])
    axes.plot(*best, "o", mfc="none", color=style.VERMILION, ms=8, mew=1.5, label="best")
    axes.set_xticks(range(len(per_rank)), per_rank)
    axes.set_yticks(range(len(largest)), largest)
    axes.set(xlabel="chunks_per_rank [1]", ylabel="largest_chunk [points]")
    drawn.legend(loc="outside upper center", ncols=2)
    drawn.colorbar(shown, label="least possible time over replayed time [%]")
    harness.save(drawn, options, "replay_constants")


def main(argv=None):
    """Measure the costs, replay, judge, draw."""
    default = Machine(attendance=schedule.parameter(schedule.ATTENDANCE, "interval"))
    parser = harness.option_parser(__doc__, repeats=3)
    helps = {
        "latency": "of a message, one way",
        "service": "of rank 0 for a request",
        "write": "to write a chunk, beside what it takes here",
    }
    for name, text in helps.items():
        value = getattr(default, name)
        parser.add_argument(f"--{name}", type=float, default=value, help=f"{text} [s] (%(default)s)")
    options = harness.prepare(parser.parse_args(argv))
    if options.quick:
        options.repeats = 1
    now = schedule.constants_of_plan()

    program = harness.Program(options.build, options.out / "runs")
    grid = QUICK_GRID if options.quick else GRID
    measured, how = costs.measure(program, "replay", options.repeats, tolerance=TOLERANCE, **grid)
    result = options.out / "runs" / "replay.h5"
    two_ranks = program.run(program.prepare("replay-2", tolerance=TOLERANCE, **grid)[0], 2)
    print(f"costs of {how['points']} points measured", flush=True)

    random = np.random.default_rng(SEED)
    shape = QUICK_FINE if options.quick else FINE
    flexible = refined(measured.flexible, shape, random)
    rigid = refined(measured.rigid, (1, shape[1]), random)
    fine = costs.Costs(measured.lengths, flexible, rigid)
    machine = replace(default, latency=options.latency, service=options.service, write=options.write)
    title = f"{shape[0] * shape[1]:,} points".replace(",", "\u2009")
    maps = [Map("map of figure 9", measured, machine), Map(title, fine, machine)]
    reports = {m.name: m.report(now, RANKS) for m in maps}
    for name, report in reports.items():
        line = report["ranks"][-1]
        share, most = (100.0 * line[k] for k in ("efficiency", "best_efficiency_of_any_tiles"))
        print(f"{name}: {share:.1f} % on {line['ranks']} ranks, at most {most:.1f} % by tiles", flush=True)
    tried = try_constants(maps, TRIED_RANKS, now)
    last = reports[maps[1].name]["ranks"][-1]["efficiency"]
    targets = {}
    if not options.quick:
        verdict = harness.judge(last, EFFICIENCY_LIMIT, at_most=False)
        targets["efficiency on 1024 ranks, 10^6 points"] = verdict
    report = {
        "part": "replay",
        "quick": options.quick,
        "provenance": harness.provenance(program, result),
        "machine": asdict(machine),
        "constants": asdict(now),
        "costs": how,
        "check_on_two_ranks": {
            "program_seconds": two_ranks.program_seconds,
            "others_share": two_ranks.others_share,
            "replayed_seconds": sum(maps[0].seconds(now, 2)),
        },
        "not_replayed": [
            "start of MPI, reading the deck, creating and opening the file",
            "contention of ranks for the network and for the file system",
        ],
        "targets": targets,
        "maps": reports,
        "best_constants": tried[0],
        "constants_tried": tried,
    }
    harness.write(options, "replay", report)
    best = tried[0]
    print(
        f"largest_chunk {now.largest_chunk}, chunks_per_rank {now.chunks_per_rank} now; best would be "
        f"{best['largest_chunk']}, {best['chunks_per_rank']}: {100 * best['least']:.1f} % of what is possible"
    )
    plot_efficiency(reports, options)
    plot_constants(tried, now, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
