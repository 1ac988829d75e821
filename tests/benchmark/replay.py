"""Replay of the scheduler on 1 to 1024 ranks with the measured costs of the points of figure 9.

Measures the cost of every point on one rank, in pieces of several sizes, spreads the costs to a map of 10^6
points, and replays the program's own rule of handing out pieces (schedule.py): the rigid twins, a pilot,
then what seems dearest, and the smaller the less is left. Writes replay.json and the figures replay and
replay_constants.
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
PARTS = ("rigid", "flexible")
RANKS = tuple(2**k for k in range(11))
GRID, QUICK_GRID = {}, {"speed_count": 115, "stiffness_count": 19}
FINE, QUICK_FINE = (400, 2500), (40, 250)  # stiffnesses, speeds
SEED = 20180720

EFFICIENCY_LIMIT = 0.90  # on 1024 ranks, 10^6 points

# Constants that are tried out, and the numbers of ranks that they must suit.
DEAREST = tuple(2**k for k in range(1, 7))
LARGEST = tuple(2**k for k in range(1, 8))
TRIED_RANKS = (4, 16, 64, 256)


def refined(tables, shape, random):
    """Costs on a finer grid over the same ranges: of a point, those of one of its measured neighbours.

    Drawn, the nearer one more often, and not averaged: averages would hide the dear points among cheap ones.
    """
    places = []
    for old, new in zip(schedule.shape_of(tables), shape, strict=True):
        at = np.linspace(0.0, old - 1.0, new)
        below = np.clip(at.astype(int), 0, max(old - 2, 0))
        places.append((below, at - below))
    (row, row_part), (speed, speed_part) = places
    rows = row[:, None] + (random.random(shape) < row_part[:, None])
    columns = speed[None, :] + (random.random(shape) < speed_part[None, :])
    return {length: table[rows, columns] for length, table in tables.items()}


class Told(schedule.Forecast):
    """A forecast that is told before what a point of each tile costs in the mean."""

    def __init__(self, work, ranks):
        super().__init__(work, ranks)
        del self.order[work.ahead :]  # no pilot
        self.known = self.timed = 1

    def rates(self):
        """The costs themselves."""
        work = self.work
        rest = range(work.ahead, len(work.chunks))
        return np.array([work.cost(c, work.chunks[c]) for c in rest]) / work.points[work.ahead :]


class Map:
    """A map whose sweep is replayed."""

    def __init__(self, name, measured, machine, now):
        self.name, self.costs, self.machine, self.now = name, measured, machine, now
        self.size = sum(measured.least(part).size for part in PARTS)
        self.known = {}
        grid = schedule.shape_of(measured.flexible)
        sizes = {costs.ALONE: (1, 1), **schedule.sizes_of(grid, now)}
        row = {length: (1, length) for length in measured.rigid}
        self.pieces = [
            # How large the pieces are in which they are written is not known: at no cost.
            schedule.pieces_of(measured.rigid, row, 0.0),
            schedule.pieces_of(measured.flexible, sizes, machine.write),
        ]

    def work(self, constants):
        """The map, cut by these constants."""
        return schedule.Work(self.costs.flexible, self.costs.rigid, constants)

    def seconds(self, constants, ranks):
        """Seconds of the whole sweep, and how many pieces it was."""
        if (constants, ranks) not in self.known:
            forecast = self.work(constants).on(ranks)
            self.known[constants, ranks] = schedule.replay(forecast, ranks, self.machine), forecast.pieces
        return self.known[constants, ranks]

    def bound(self, ranks):
        """No schedule is done earlier [s]: the work is shared evenly, but no point is divided."""
        return schedule.lower_bound(np.concatenate([self.costs.least(p).ravel() for p in PARTS]), ranks)

    def tile_bound(self, ranks):
        """No schedule of tiles is done earlier [s], even if it knew all costs and cut each tile best."""
        return schedule.tile_bound(self.pieces, ranks)

    def of_bound(self, constants, ranks):
        """The least possible time over that of all ranks together; what is lost is lost to the schedule."""
        return self.bound(ranks) / self.seconds(constants, ranks)[0]

    def what_if(self, ranks):
        """Efficiencies of other rules on so many ranks."""
        work = self.work(self.now)
        whole = [work.cost(c, chunk) for c, chunk in enumerate(work.chunks)]
        small = []
        for c, chunk in enumerate(work.chunks):
            halvings = schedule.most_halvings(chunk, self.now.smallest_piece, self.now.aspect)
            parts = (schedule.part_of(chunk, halvings, k, self.now.aspect) for k in range(2**halvings))
            small += [work.cost(c, part) for part in parts]
        single = np.concatenate([getattr(self.costs, part)[costs.ALONE].ravel() for part in PARTS])
        rules = {
            "whole tiles, softest support first": whole,
            "whole tiles, dearest first, as if known before": sorted(whole, reverse=True),
            "smallest pieces, softest support first": small,
            "smallest pieces, dearest first, as if known before": sorted(small, reverse=True),
            "single points, dearest first, as if known before": np.sort(single)[::-1],
        }
        rules = {name: schedule.InOrder(rule) for name, rule in rules.items()}
        # Who knows what is dear need not cut as much.
        for dearest in (2, 4, self.now.dearest_part):
            told = Told(self.work(replace(self.now, dearest_part=dearest)), ranks)
            rules[f"as it is, the mean cost of each tile known before, dearest_part {dearest}"] = told
        one = self.seconds(self.now, 1)[0]
        return {
            name: one / (ranks * schedule.replay(rule, ranks, self.machine)) for name, rule in rules.items()
        }

    def report(self, all_ranks):
        """The replay with the constants as they are."""
        one = self.seconds(self.now, 1)[0]
        lines = []
        for ranks in all_ranks:
            seconds, pieces = self.seconds(self.now, ranks)
            lines.append(
                {
                    "ranks": ranks,
                    "pieces": pieces,
                    "points_of_the_smallest": self.now.fewest(self.size, ranks),
                    "seconds": seconds,
                    "efficiency": one / (ranks * seconds),
                    "best_efficiency_of_any_schedule": min(1.0, one / (ranks * self.bound(ranks))),
                    "best_efficiency_of_any_tiles": min(1.0, one / (ranks * self.tile_bound(ranks))),
                }
            )
        return {
            "points": self.size,
            "seconds_on_one_rank": one,
            "dearest_smallest_piece_seconds": float(self.pieces[1][1][1].max()),
            "dearest_point_seconds": {
                part: float(getattr(self.costs, part)[costs.ALONE].max()) for part in PARTS
            },
            "ranks": lines,
            "other_rules": {str(ranks): self.what_if(ranks) for ranks in all_ranks[-5::2]},
        }


def try_constants(maps, all_ranks, now):
    """How near to the best possible time other constants come; the best in the mean first."""
    tried = []
    for dearest in sorted({*DEAREST, now.dearest_part}):
        for largest in sorted({*LARGEST, now.largest_part}):
            constants = replace(now, dearest_part=dearest, largest_part=largest)
            each = {m.name: {n: m.of_bound(constants, n) for n in all_ranks} for m in maps}
            values = [value for by_ranks in each.values() for value in by_ranks.values()]
            tried.append(
                {
                    "dearest_part": dearest,
                    "largest_part": largest,
                    "least": min(values),
                    "mean": float(np.mean(values)),
                    "of_bound": each,
                }
            )
        print(f"constants: dearest_part {dearest} tried", flush=True)
    return sorted(tried, key=lambda t: -round(t["mean"], 3))


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
    dearest = sorted({t["dearest_part"] for t in tried})
    largest = sorted({t["largest_part"] for t in tried})
    mean = np.full((len(dearest), len(largest)), np.nan)
    for t in tried:
        mean[dearest.index(t["dearest_part"]), largest.index(t["largest_part"])] = 100.0 * t["mean"]
    shown = axes.imshow(mean, origin="lower", aspect="auto", cmap=style.SEQUENTIAL)
    here = largest.index(now.largest_part), dearest.index(now.dearest_part)
    axes.plot(*here, "x", color=style.VERMILION, ms=7, mew=1.5, label="as they are")
    best = largest.index(tried[0]["largest_part"]), dearest.index(tried[0]["dearest_part"])
    axes.plot(*best, "o", mfc="none", color=style.VERMILION, ms=8, mew=1.5, label="best")
    axes.set_xticks(range(len(largest)), largest)
    axes.set_yticks(range(len(dearest)), dearest)
    axes.set(xlabel="largest_part [1]", ylabel="dearest_part [1]")
    drawn.legend(loc="outside upper center", ncols=2)
    drawn.colorbar(shown, label="least possible time over replayed time, mean [%]")
    harness.save(drawn, options, "replay_constants")


def main(argv=None):
    """Measure the costs, replay, judge, draw."""
    default = Machine(attendance=schedule.parameter(schedule.ATTENDANCE, "interval"))
    parser = harness.option_parser(__doc__, repeats=3)
    helps = {
        "latency": "of a message, one way",
        "service": "of rank 0 for a request",
        "write": "to write a piece, beside what it takes here",
    }
    for name, text in helps.items():
        value = getattr(default, name)
        parser.add_argument(f"--{name}", type=float, default=value, help=f"{text} [s] (%(default)s)")
    options = harness.prepare(parser.parse_args(argv))
    if options.quick:
        options.repeats = 1
    now = schedule.constants_now()

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
    fine = costs.Costs(flexible, rigid)
    machine = replace(default, latency=options.latency, service=options.service, write=options.write)
    title = f"{shape[0] * shape[1]:,} points".replace(",", "\u2009")
    maps = [Map("map of figure 9", measured, machine, now), Map(title, fine, machine, now)]
    reports = {m.name: m.report(RANKS) for m in maps}
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
            "replayed_seconds": maps[0].seconds(now, 2)[0],
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
        f"dearest_part {now.dearest_part}, largest_part {now.largest_part} now; best would be "
        f"{best['dearest_part']}, {best['largest_part']}: {100 * best['mean']:.1f} % of what is possible, "
        "in the mean"
    )
    plot_efficiency(reports, options)
    plot_constants(tried, now, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
