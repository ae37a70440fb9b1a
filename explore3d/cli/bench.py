"""explore3d bench: error and speed against run time, for one stage at a time."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from explore3d import UserError, parse_length, parse_rate, parse_speed
from explore3d.cli.options import Json

if TYPE_CHECKING:
    from explore3d.bench.precision import Measured

bench = typer.Typer(invoke_without_command=True)

SAMPLING_METHODS = ("importance", "emcee")


def _store(path: Path | None) -> Path | None:
    """A file that the first finished run can be written to: else hours would be lost at their end."""
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        found = "a folder" if path.is_dir() else f"no folder {path.parent}"
        raise UserError(f"--store {path}: expected a file in a folder that is there; found {found}")
    return path


_STORED = typer.Option("--store", callback=_store, help="JSONL file of finished runs; what it holds is not run again.")
Store = Annotated[Path, _STORED]


@bench.callback()
def all_stages(
    context: typer.Context,
    quick: Annotated[bool, typer.Option("--quick", help="Few settings and repeats: under two minutes.")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for page, tables and pictures.")] = Path("out/bench"),
    peers: Annotated[
        bool, typer.Option("--peers", help="Measure other programs too, where they are installed.")
    ] = False,
    json: Json = False,
) -> None:
    """Measure error against run time: all stages, or one of them by a command of its own; ends with 1 if one fails.

    Example: explore3d bench --quick --out out/bench
    """
    if context.invoked_subcommand is not None:
        if json:
            raise UserError(f"--json: is of all stages together; bench {context.invoked_subcommand} has its own output")
        return
    from json import dumps

    from explore3d.bench.precision import as_record, bench as run, summary, write

    def told(each: Measured) -> None:
        if not json:
            print(f"{each.stage.name:20}{len(each.points):4} points{each.seconds:8.1f} s", flush=True)

    out.mkdir(parents=True, exist_ok=True)  # what cannot be written is said before minutes are spent
    measured = run(quick, peers, told)
    page = write(measured, out, quick)
    if json:
        print(dumps(as_record(measured, quick) | {"page": str(page), "summary": summary(measured)}))
    else:
        print(f"page: {page}\n{summary(measured)}")
    if not all(each.points for each in measured):
        raise typer.Exit(1)


@bench.command()
def trace(
    triangles: Annotated[
        str | None, typer.Option(help="Sizes of the mesh, separated by commas; 20000,200000,2000000 if left out.")
    ] = None,
    side: Annotated[
        int | None, typer.Option(min=2, help="Queries along each side of the grid; 256 if left out.")
    ] = None,
    peers: Annotated[bool, typer.Option(help="Time OpenCAMLib, coal and Open3D's rays as well, if installed.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="20,000 triangles, 128 queries to a side, peers 1 s.")] = False,
) -> None:
    """Ball centres per second over the paper's bump, on one core: two meshes of each size, three balls, two layouts.

    Example: explore3d bench trace --triangles 20000,200000 --peers
    """
    from explore3d.bench import PEER_SECONDS, TRACED_MESH_SIZES, bench_trace, trace_methods, trace_table

    sizes = [int(n) for n in _numbers(triangles)] if triangles else TRACED_MESH_SIZES[: 1 if quick else None]
    methods, missing = trace_methods(peers)
    _print(missing)
    seconds = 1.0 if quick else PEER_SECONDS
    timings = bench_trace(sizes, side=side or (128 if quick else 256), methods=methods, peer_seconds=seconds)
    _print(trace_table(timings))


@bench.command()
def curvature(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for table and picture.")] = Path("out/curvature"),
    largest: Annotated[int, typer.Option(min=10_000, help="Most vertices; tenfold steps from 10 000.")] = 100_000,
    peers: Annotated[bool, typer.Option(help="Measure libigl, pymeshlab and a plain jet too.")] = True,
    cells: Annotated[
        bool, typer.Option(help="Five bodies, three samplings, four noises: errors, apex and coverage; not the speed.")
    ] = False,
    seeds: Annotated[int, typer.Option(min=1, max=3, help="Seeds of each cell.")] = 3,
    building: Annotated[bool, typer.Option("--building", help="Cells of seeds that may be looked into.")] = False,
) -> None:
    """Error, speed and memory of principal curvatures on bodies that have them in closed form.

    Example: explore3d bench curvature --largest 1000000 --out out/curvature
    """
    if building and not cells:
        raise UserError("--building: names the seeds of cells; add --cells, or leave it out")
    from explore3d.bench import CurvatureAccuracy, available, bench_curvature, curvature_table, write_bench

    methods, missing = available()
    if peers:
        _print(missing)
    if cells:
        _curvature_cells(["explore3d", "jets alone", *methods[1:]] if peers else methods[:1], seeds, building, out)
        return
    sizes = [count for count in (10_000, 100_000, 1_000_000) if count <= largest]
    lines: list[CurvatureAccuracy] = []

    def kept() -> Iterable[CurvatureAccuracy]:
        for line in bench_curvature(sizes, methods if peers else methods[:1]):
            lines.append(line)
            yield line

    _print(curvature_table(kept()))
    _print(map(str, write_bench(lines, out)))


def _curvature_cells(methods: list[str], seeds: int, building: bool, out: Path) -> None:
    from explore3d.bench import CurvatureCell, bench_cells, cell_table, cell_verdicts, write_cells

    lines: list[CurvatureCell] = []

    def kept() -> Iterable[CurvatureCell]:
        for line in bench_cells(methods, seeds, building):
            lines.append(line)
            yield line

    _print(cell_table(kept()))
    _print(cell_verdicts(lines))
    _print(map(str, write_cells(lines, out)))


@bench.command()
def posterior() -> None:
    """Effective draws per second, beside emcee's default settings.

    Example: explore3d bench posterior
    """
    from explore3d.bench.posterior import Timing, bench_posterior

    def line(timing: Timing) -> None:
        print(
            f"{timing.name:40}{timing.samples:9} samples{timing.bins:7} bins{timing.seconds:9.2f} s"
            f"{timing.rate:10.0f} draws/s  {timing.status}",
            flush=True,
        )

    bench_posterior(line)


@bench.command()
def calibration(
    store: Store,
    seeds: Annotated[int, typer.Option(min=1, help="Simulations of each shape and noise.")] = 12,
    method: Annotated[str, typer.Option(help="importance (the fast path) or emcee.")] = "importance",
    shapes: Annotated[str | None, typer.Option(help="Shapes, separated by commas; all if left out.")] = None,
    believed: Annotated[str, typer.Option(help="true; white: correlated noise taken for white.")] = "true",
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
    ranks: Annotated[Path | None, typer.Option(help="PNG for the rank histograms.")] = None,
    record: Annotated[Path | None, typer.Option(help="JSON for all verdicts.")] = None,
) -> None:
    """Do 90 % intervals cover 90 %? Simulates features from their priors and analyses them.

    Example: explore3d bench calibration --store calibration.jsonl --seeds 100
    """
    from explore3d.bench.posterior import (
        CALIBRATED_KINDS,
        by_kind,
        calibrate,
        campaign,
        draw_ranks,
        verdicts,
        write_record,
    )

    for option, found, possible in (
        ("--method", method, SAMPLING_METHODS),
        ("--believed", believed, ("true", "white")),
    ):
        if found not in possible:
            raise UserError(f"{option}: expected {' or '.join(possible)}; found {found!r}")
    chosen = _names(shapes, "--shapes", list(CALIBRATED_KINDS))
    rows = calibrate(campaign(chosen, seeds, method, believed), store, seconds)
    for kind, group in by_kind(rows).items():
        for name, verdict in verdicts(group).items():
            print(
                f"{kind:8}{name:14}{verdict.count:6} simulations, {100 * verdict.coverage:5.1f} % covered"
                f" (90 +- {100 * verdict.tolerance:.1f} %), uniform with p = {verdict.p_value:.2f}",
                flush=True,
            )
    if ranks and rows:
        draw_ranks(rows, ranks)
    if record and rows:
        write_record(rows, record)


@bench.command()
def odds(
    store: Store,
    seeds: Annotated[int, typer.Option(min=1, help="Simulations of each pair, or plates.")] = 50,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
    counts: Annotated[
        bool, typer.Option("--counts", help="Plates of none to five details: how many are there?")
    ] = False,
    building: Annotated[bool, typer.Option("--building", help="The plates that may be looked into.")] = False,
    without: Annotated[str, typer.Option(help="A proposal that is not made on the plates.")] = "",
) -> None:
    """Do stated probabilities come true: bump or nothing, ridge or bump, two ridges or one, how many?

    Example: explore3d bench odds --store odds.jsonl --seeds 200
    Example: explore3d bench odds --store counts.jsonl --counts --seeds 1000
    """
    from explore3d.bench.posterior import bench_counts, bench_odds, counts_table, odds_table
    from mapping.inference.configuration import PROPOSALS

    if counts:
        _names(without or None, "--without", [proposal.name for proposal in PROPOSALS])
        counts_table(bench_counts(store, seeds, seconds, building=building, without=without), print)
        return
    odds_table(bench_odds(store, seeds, seconds), print)


@bench.command()
def explore(
    store: Annotated[Path | None, _STORED] = None,
    scenes: Annotated[str | None, typer.Option(help="Scenes, separated by commas; all if left out.")] = None,
    strategies: Annotated[str | None, typer.Option(help="Strategies, separated by commas; all if left out.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of the features' places and of the noise.")] = 3,
    noise: Annotated[str, typer.Option(help="apparatus, or correlated: over half a wire's width.")] = "apparatus",
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
    out: Annotated[Path | None, typer.Option(help="Folder for the table and the curves of all finished runs.")] = None,
    write: Annotated[
        Path | None, typer.Option("--write-scenes", help="Only write the scenes as files for explore3d run, there.")
    ] = None,
) -> None:
    """Error of the found extents against finger time: exploring beside rasters, random and ergodic sweeps.

    Example: explore3d bench explore --store explore.jsonl --scenes straight,empty --seeds 1
    Example: explore3d bench explore --write-scenes scenes --scenes straight --seeds 1
    """
    import json

    from explore3d.bench.exploration import (
        FINGER_NOISES,
        STRATEGIES,
        bench_exploring,
        records,
        write_bench_scenes,
        write_curves,
    )
    from explore3d.bench.scenes import SCENES

    chosen = _names(scenes, "--scenes", list(SCENES)), _names(strategies, "--strategies", list(STRATEGIES))
    _names(noise, "--noise", list(FINGER_NOISES))
    if write is not None:
        _print(str(path) for path in write_bench_scenes(chosen[0], seeds, write, noise))
        return
    if store is None:
        raise UserError("--store: give the JSONL file of finished runs, or --write-scenes a folder")
    _print(json.dumps(record) for record in bench_exploring(*chosen, seeds, store, noise, seconds))
    if out is not None:
        _print(str(path) for path in write_curves([r for r in records(store) if r["noise"] == noise], out))


@bench.command()
def bodies(
    store: Store,
    bodies: Annotated[str | None, typer.Option(help="Bodies, separated by commas; all if left out.")] = None,
    seeds: Annotated[
        str, typer.Option(help="reported, building (what the planner was built with), or numbers, separated by commas.")
    ] = "reported",
    meshes: Annotated[
        Path | None, typer.Option(help="Folder of bunny.off, spot.obj and fandisk.off, which do not come with us.")
    ] = None,
    keep: Annotated[Path | None, typer.Option(help="Keep scenes and sessions there.")] = None,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Is all of a body swept that can be reached, safely, and is what lies on it found? By `explore3d run`.

    Example: explore3d bench bodies --store bodies.jsonl --bodies l_bracket,bowl --seeds building
    """
    from explore3d.bench.exploration import bench_bodies, body_lines, body_records
    from explore3d.bench.scenes import ANY_BODIES, BODY_BUILDING_SEEDS, BODY_REPORTED_SEEDS, FILED_BODIES

    chosen = _names(bodies, "--bodies", list(ANY_BODIES))
    there = [name for name in chosen if name not in FILED_BODIES or (meshes and (meshes / FILED_BODIES[name]).exists())]
    for name in chosen:
        if name not in there:
            missing = f"is not in {meshes}" if meshes else "does not come with the program; give its folder by --meshes"
            print(f"{name}: left out, {FILED_BODIES[name]} {missing}")
    if not there:
        raise UserError(f"--meshes: nothing of {', '.join(chosen)} is left to explore")
    known = {"reported": BODY_REPORTED_SEEDS, "building": BODY_BUILDING_SEEDS}
    numbers = known[seeds] if seeds in known else tuple(int(number) for number in _numbers(seeds, "--seeds", 1))
    for each in bench_bodies(there, numbers, store, meshes, keep, seconds):
        print(
            f"{each['body']}, {each['seed']}: {100 * each['swept']:.1f} % swept, {each['found']} of "
            f"{each['reachable_features']} found, {len(each['invented'])} invented, {each['refused']} refused",
            flush=True,
        )
    _print(body_lines(body_records(store)))


@bench.command()
def detect(
    store: Store,
    out: Annotated[Path, typer.Option(help="Folder for the table and the pictures.")],
    seeds: Annotated[int, typer.Option(min=1, help="Sweeps of each size and noise.")] = 20,
    quick: Annotated[bool, typer.Option(help="Few sizes and one level of noise.")] = False,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
    bodies: Annotated[bool, typer.Option(help="False alarms on smooth bodies instead.")] = False,
    mesh: Annotated[Path | None, typer.Option(help="With --bodies: a mesh to sweep over as well.")] = None,
) -> None:
    """Recall and false alarms per metre against size and noise, for each detector of a single sweep.

    Example: explore3d bench detect --store detect.jsonl --out curves --quick --seeds 2
    """
    from explore3d.bench.detection import (
        all_cases,
        bench_detect,
        bench_false_alarms,
        cells,
        false_alarm_lines,
        write_curves,
    )

    if bodies:
        _print(false_alarm_lines(bench_false_alarms(seeds, store, seconds, mesh)))
        return
    records = bench_detect(all_cases(seeds, quick), store, seconds)
    _print(str(path) for path in write_curves(cells(records), out))


@bench.command()
def classify(
    store: Store,
    bodies: Annotated[str | None, typer.Option(help="Bodies, separated by commas; all if left out.")] = None,
    noises: Annotated[str | None, typer.Option(help="none, apparatus or both, separated by a comma.")] = None,
    sweeps: Annotated[str | None, typer.Option(help="Patterns of sweeps, separated by commas.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of the noise and of the sweeps' placement.")] = 5,
    building: Annotated[bool, typer.Option("--building", help="The seeds and sizes that may be looked into.")] = False,
) -> None:
    """Is each kind of feature found and rightly named, and nothing invented? As CSV.

    Example: explore3d bench classify --store classify.jsonl --bodies bump,ridge --seeds 100
    """
    from explore3d.bench.detection import NOISE_SOURCES, SWEEP_PATTERNS, bench_classify, classify_table
    from explore3d.bench.scenes import CLASSIFIED, FIRST_BUILT_WITH

    chosen = _names(bodies, "--bodies", list(CLASSIFIED)), _names(noises, "--noises", list(NOISE_SOURCES))
    patterns = _names(sweeps, "--sweeps", list(SWEEP_PATTERNS))
    first = FIRST_BUILT_WITH if building else 0
    print(classify_table(list(bench_classify(*chosen, patterns, range(first, first + seeds), store))), end="")


@bench.command()
def deviation(
    store: Store,
    bodies: Annotated[str | None, typer.Option(help="Bodies, separated by commas; those reported if left out.")] = None,
    wrongs: Annotated[str | None, typer.Option(help="What is wrong, separated by commas; all if left out.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of bodies, wrongs and noise.")] = 5,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Is it named what is wrong with a mesh, is anything invented on it, and what does it cost the finger?

    Example: explore3d bench deviation --store wrong.jsonl --bodies plate --wrongs nothing,pose --seeds 2
    """
    from explore3d.bench import bench_wrong_models, wrong_model_lines, wrong_model_records
    from explore3d.bench.scenes import REPORTED, WRONG_BODIES, WRONGS

    chosen = _names(bodies, "--bodies", list(WRONG_BODIES)) if bodies else list(REPORTED)
    for each in bench_wrong_models(chosen, _names(wrongs, "--wrongs", list(WRONGS)), seeds, store, seconds):
        named = "named" if each["named"] else "NOT named"
        print(f"{each['body']}, {each['wrong']}, {each['seed']}: {named}, {each['invented']} invented", flush=True)
    _print(wrong_model_lines(wrong_model_records(store)))


@bench.command()
def trust(
    store: Store,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for page, Markdown and JSON.")] = None,
    of: Annotated[
        str, typer.Option("--set", help="building, or reported: seeds and scales that nothing was built with.")
    ] = "building",
    laws: Annotated[str | None, typer.Option(help="Laws of error, separated by commas; all if left out.")] = None,
    bodies: Annotated[str | None, typer.Option(help="Bodies, separated by commas; all if left out.")] = None,
    metres: Annotated[float, typer.Option(min=1.0, help="Bare path of each law, m.")] = 300.0,
    wires: Annotated[int, typer.Option(min=0, help="Wires of each law that are found and measured.")] = 198,
    quick: Annotated[bool, typer.Option("--quick", help="5 m and 3 wires of each law: minutes.")] = False,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Do promises hold under noise of any law? False alarms, invented features, limits, intervals, computing time.

    Example: explore3d bench trust --store trust.jsonl --out trust --laws white,1/f --quick
    """
    from explore3d.bench.trust import (
        LAWS,
        TRUST_BODIES,
        TRUST_SETS,
        bench_trust,
        law_verdicts,
        recordings_of,
        trust_line,
        trust_records,
        verdict_lines,
        write_trust,
    )

    _names(of, "--set", list(TRUST_SETS))
    chosen = _names(laws, "--laws", list(LAWS)), _names(bodies, "--bodies", list(TRUST_BODIES))
    bare, wired = recordings_of(*((5.0, 3) if quick else (metres, wires)))
    for each in bench_trust(of, *chosen, bare, wired, store, seconds):
        print(f"{each['law']}, {each['body']}, {each['number']}: {trust_line(each)}", flush=True)
    records = [each for each in trust_records(store) if each["of"] == of]
    _print(verdict_lines(law_verdicts(records)))
    if out is not None:
        _print(str(path) for path in write_trust(records, of, out))


@bench.command()
def tips(
    store: Store,
    of: Annotated[
        str, typer.Option("--set", help="building, or reported: seeds and scales that nothing was built with.")
    ] = "building",
    tips: Annotated[str | None, typer.Option(help="What the tip really is, separated by commas; all.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Recordings of each tip; three wires lie under each.")] = 30,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Is it named that a tip is not as said, are wires found, and do their sizes hold? As a table of Markdown.

    Example: explore3d bench tips --store tips.jsonl --tips "5 % larger,worn" --seeds 2
    """
    from explore3d.bench.trust import TRUST_SETS, WRONG_TIPS, bench_tips, tip_line, tip_table, trust_records

    _names(of, "--set", list(TRUST_SETS))
    for each in bench_tips(of, _names(tips, "--tips", list(WRONG_TIPS)), seeds, store, seconds):
        print(f"{each['tip']}, {each['number']}: {tip_line(each)}", flush=True)
    print(tip_table([each for each in trust_records(store) if each["of"] == of]))


@bench.command()
def sections(
    store: Store,
    bodies: Annotated[str | None, typer.Option(help="Sections, separated by commas; all if left out.")] = None,
    noises: Annotated[str | None, typer.Option(help="Noises, separated by commas; all if left out.")] = None,
    tips: Annotated[str, typer.Option(help="Radii of the tip, mm, separated by commas.")] = "10",
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of place, slant, number of sweeps and noise.")] = 20,
    building: Annotated[bool, typer.Option("--building", help="The seeds and sizes that may be looked into.")] = False,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Are the sizes of lines that are no half-cylinder true, bounds, or remarked upon? As CSV.

    Example: explore3d bench sections --store sections.jsonl --bodies rectangle,triangle --seeds 2
    """
    from explore3d.bench import bench_sections, section_lines
    from explore3d.bench.scenes import FIRST_BUILT_WITH, SECTION_BODIES, SECTION_NOISES

    chosen = _names(bodies, "--bodies", list(SECTION_BODIES)), _names(noises, "--noises", list(SECTION_NOISES))
    first = FIRST_BUILT_WITH if building else 0
    radii = [1e-3 * int(each) for each in _numbers(tips, "--tips", 1)]
    _print(section_lines(list(bench_sections(*chosen, range(first, first + seeds), store, seconds, radii))))


@bench.command()
def shapes(
    store: Store,
    shapes: Annotated[str | None, typer.Option(help="Shapes, separated by commas; all if left out.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of place, rows and noise.")] = 20,
    building: Annotated[bool, typer.Option("--building", help="The seeds and sizes that may be looked into.")] = False,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for table and picture.")] = None,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Are curves, letters, neighbours and lines on curved bodies told in kind, number, course and size? As CSV.

    Example: explore3d bench shapes --store shapes.jsonl --shapes "S 10 mm,A" --seeds 2
    """
    from explore3d.bench.detection import bench_shapes, shape_lines, write_shapes
    from explore3d.bench.scenes import FELT_SHAPES, FIRST_BUILT_WITH

    first = FIRST_BUILT_WITH if building else 0
    chosen = _names(shapes, "--shapes", list(FELT_SHAPES))
    records = []
    for each in bench_shapes(chosen, range(first, first + seeds), store, seconds):
        records.append(each)
        told = ", ".join(each["kinds"]) or "nothing"
        print(f"{each['shape']}, {each['seed']}: {each['judged']} ({told}), {each['cpu']:.1f} s", flush=True)
    _print(shape_lines(records))
    if out is not None and records:
        _print(str(path) for path in write_shapes(records, out))


@bench.command()
def profiles(
    forms: Annotated[str | None, typer.Option(help="Forms, separated by commas; all if left out.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Profiles of each form.")] = 10,
    rows: Annotated[int, typer.Option(min=1, help="Rows of a raster that the detail crosses; 1: a profile.")] = 1,
    building: Annotated[bool, typer.Option("--building", help="The seeds that may be looked into.")] = False,
) -> None:
    """Are scratches, slots, steps and humps of a rough profile, or of a raster, found with true sizes? As CSV.

    Example: explore3d bench profiles --forms slot,step --seeds 2
    """
    from explore3d.bench.precision import FIRST_REPORTED, PROFILE_FORMS, bench_profiles

    first = 0 if building else FIRST_REPORTED
    for line in bench_profiles(_names(forms, "--forms", list(PROFILE_FORMS)), range(first, first + seeds), rows):
        print(line, flush=True)


@bench.command()
def lengths(
    forms: Annotated[str | None, typer.Option(help="Lines and their ends, separated by commas.")] = None,
    noises: Annotated[str | None, typer.Option(help="white, OU or both, separated by a comma.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Lines of each form and noise.")] = 20,
    building: Annotated[bool, typer.Option("--building", help="The seeds that may be looked into.")] = False,
) -> None:
    """Do 90 % intervals of lines' lengths hold the truth, however their ends are made? As CSV.

    Example: explore3d bench lengths --forms "round wire,stadium bar" --noises white --seeds 3
    """
    from explore3d.bench.precision import LENGTHS_FORMS, LENGTHS_NOISES, bench_lengths
    from explore3d.bench.scenes import FIRST_BUILT_WITH

    chosen = _names(forms, "--forms", list(LENGTHS_FORMS)), _names(noises, "--noises", list(LENGTHS_NOISES))
    first = FIRST_BUILT_WITH if building else 0
    for line in bench_lengths(*chosen, range(first, first + seeds)):
        print(line, flush=True)


@bench.command()
def labels(
    bodies: Annotated[str | None, typer.Option(help="Bodies, separated by commas; all if left out.")] = None,
    files: Annotated[Path | None, typer.Option(help="Folder of published bodies: bunny.off, ...")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="One radius, one pitch and one direction only.")] = False,
) -> None:
    """Are labels of estimated points true? Exact rasters over bodies: touched, off, outside their intervals; as CSV.

    Example: explore3d bench labels --bodies holed_plate --quick
    """
    from explore3d.bench.precision import LABEL_BODIES, bench_labels, label_lines

    chosen = _names(bodies, "--bodies", list(LABEL_BODIES))
    cases = bench_labels(chosen, files, [0.05], [5], 1) if quick else bench_labels(chosen, files)
    for line in label_lines(cases):
        print(line, flush=True)


@bench.command()
def dynamics() -> None:
    """Computing time and error of stiff contact over the stiffness, as CSV.

    Example: explore3d bench dynamics
    """
    from explore3d.bench import dynamics_curve, dynamics_table

    print(dynamics_table(dynamics_curve()), end="")


@bench.command()
def touch(
    trials: Annotated[int, typer.Option(min=1, help="Pairs of strokes for each stimulus, noise and height.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise.")] = 0,
    correlation: Annotated[str, typer.Option(help="Length over which correlated noise is, with unit.")] = "1 mm",
    noises: Annotated[str | None, typer.Option(help="white, correlated, range, separated by commas; all.")] = None,
) -> None:
    """LaMotte's task: which of two strokes went over something? Answers of the detector, the best possible, people's.

    Example: explore3d bench touch --trials 20
    """
    from explore3d.bench.display import HEAD_NOISES, bench_touch, touch_lines

    length = parse_length(correlation)
    if not length > 0.0:
        raise UserError(f"--correlation: expected a length above 0; found {correlation!r}")
    answers = []
    for each in bench_touch(trials, seed, length, _names(noises, "--noises", list(HEAD_NOISES))):
        answers.append(each)
        told = f"{each.stimulus}, {each.noise}, {1e6 * each.height:.2f} um: {100.0 * each.right:.0f} % right"
        best = f"{100.0 * each.place_unknown:.0f} % possible, {100.0 * each.place_known:.0f} % where its place is known"
        print(f"{told}; {best}", flush=True)
    _print(touch_lines(answers))


@bench.command()
def display(
    seconds: Annotated[float, typer.Option(help="By the clock, at each rate.")] = 30.0,
    rates: Annotated[str, typer.Option(help="Steps per second, with unit, separated by commas.")] = "1 kHz,10 kHz",
    speed: Annotated[str, typer.Option(help="Of the hand, with unit.")] = "30 mm/s",
) -> None:
    """Time of a step, and jitter of the loop, of a display with 20,000 triangles and 20 features.

    Example: explore3d bench display --seconds 10
    """
    from explore3d.bench.display import bench_stepping, stepping_lines

    asked, fast = [parse_rate(each) for each in rates.split(",")], parse_speed(speed)
    if not (0.0 < seconds < float("inf") and min(asked) > 0.0 and fast > 0.0):
        raise UserError(
            f"--seconds, --rates, --speed: expected numbers above 0; found {seconds:g}, {rates!r} and {speed!r}"
        )
    _print(stepping_lines(list(bench_stepping(asked, seconds, fast))))


@bench.command()
def circle(
    store: Store,
    bodies: Annotated[str | None, typer.Option(help="Kinds, separated by commas; all if left out.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of sizes, places and noise.")] = 3,
    building: Annotated[bool, typer.Option("--building", help="The seeds that may be looked into.")] = False,
    seconds: Annotated[float, typer.Option(help="Stop after this long; the same command goes on.")] = float("inf"),
) -> None:
    """Explored, displayed, and explored again through the display: are the features the same?

    Example: explore3d bench circle --store circle.jsonl --bodies bump,pit --seeds 2
    """
    from explore3d.bench.display import bench_circle, circle_lines
    from explore3d.bench.scenes import DRAWN_KINDS, FIRST_BUILT_WITH

    first = FIRST_BUILT_WITH if building else 0
    records = []
    chosen = _names(bodies, "--bodies", list(DRAWN_KINDS))
    for each in bench_circle(chosen, range(first, first + seeds), store, seconds):
        records.append(each)
        inside = sum(size["inside"] for size in each["sizes"])
        print(f"{each['body']}, {each['seed']}: {inside} of {len(each['sizes'])} sizes", flush=True)
    _print(circle_lines(records))


@bench.command()
def scaling(
    store: Store,
    axes: Annotated[
        str | None, typer.Option(help="samples, triangles, features, surface, separated by commas; all.")
    ] = None,
    huge: Annotated[bool, typer.Option("--huge", help="Up to 1e8 samples: 2 GB of disk, many minutes.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="The three smallest sizes of each.")] = False,
) -> None:
    """Time and memory against samples, triangles, features and swept samples, and the exponents that fit.

    Example: explore3d bench scaling --store scaling.jsonl --axes samples --quick
    """
    from explore3d.bench import AXES, bench_scaling, scaling_lines

    _print(scaling_lines(bench_scaling(store, _names(axes, "--axes", list(AXES)), huge, quick)))


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        print(line, flush=True)


def _numbers(text: str, option: str = "--triangles", least: int = 2) -> list[str]:
    parts = [part.strip() for part in text.split(",") if part.strip()]
    wrong = [part for part in parts if not part.isdigit() or int(part) < least]
    if wrong or not parts:
        raise UserError(f"{option}: expected whole numbers from {least}, separated by commas; found {text!r}")
    return parts


def _names(text: str | None, option: str, possible: list[str]) -> list[str]:
    chosen = possible if text is None else [part.strip() for part in text.split(",")]
    wrong = [name for name in chosen if name not in possible]
    if wrong:
        raise UserError(f"{option}: unknown {wrong[0]!r}; possible: {', '.join(possible)}")
    return chosen
