"""Simulated bodies, sweeps and noises that benches share."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.scenes.any_body import (
        ANY_BODIES as ANY_BODIES,
        BODY_BUILDING_SEEDS as BODY_BUILDING_SEEDS,
        BODY_REPORTED_SEEDS as BODY_REPORTED_SEEDS,
        FILED_BODIES as FILED_BODIES,
        any_body as any_body,
        filed_body as filed_body,
    )
    from explore3d.bench.scenes.bodies import (
        Mesh as Mesh,
        blob as blob,
        blob_normals as blob_normals,
        cylinder as cylinder,
        joined as joined,
        sphere_mesh as sphere_mesh,
        tube as tube,
    )
    from explore3d.bench.scenes.curved_bodies import (
        CURVED_BODIES as CURVED_BODIES,
        SAMPLINGS as SAMPLINGS,
        CurvedBody as CurvedBody,
        curved_body as curved_body,
    )
    from explore3d.bench.scenes.drawn_kinds import DRAWN_KINDS as DRAWN_KINDS
    from explore3d.bench.scenes.exploring import (
        BENCH_TIP_RADIUS as BENCH_TIP_RADIUS,
        SCENES as SCENES,
        BenchScene as BenchScene,
    )
    from explore3d.bench.scenes.kinds import (
        BODIES_BY_KIND as BODIES_BY_KIND,
        INSPECTED_HALF_SIDE as INSPECTED_HALF_SIDE,
        MIDDLE as MIDDLE,
    )
    from explore3d.bench.scenes.laid_on import (
        Detail as Detail,
        drawn_details as drawn_details,
        laid_on as laid_on,
    )
    from explore3d.bench.scenes.long_log import write_long_log as write_long_log
    from explore3d.bench.scenes.neighbours import CLASSIFIED as CLASSIFIED, classified_body as classified_body
    from explore3d.bench.scenes.noise import SAMPLE_SPACING as SAMPLE_SPACING, simulate_noise as simulate_noise
    from explore3d.bench.scenes.plate_sweeps import (
        DIAMETER as DIAMETER,
        HALF as HALF,
        TIP_RADIUS as TIP_RADIUS,
        Heights as Heights,
        features as features,
        plate as plate,
        scaled as scaled,
        sweeps as sweeps,
        wire as wire,
    )
    from explore3d.bench.scenes.sections import (
        FIRST_BUILT_WITH as FIRST_BUILT_WITH,
        SECTION_BODIES as SECTION_BODIES,
        SECTION_NOISES as SECTION_NOISES,
        SECTION_TIP as SECTION_TIP,
        TRUE_FAMILIES as TRUE_FAMILIES,
        dilated as dilated,
        section_body as section_body,
        section_trace as section_trace,
    )
    from explore3d.bench.scenes.shapes import (
        FELT_SHAPES as FELT_SHAPES,
        SHAPE_PITCH as SHAPE_PITCH,
        FeltShape as FeltShape,
        felt_shape as felt_shape,
        resampled as resampled,
    )
    from explore3d.bench.scenes.wrong_models import (
        REPORTED as REPORTED,
        WRONG_BODIES as WRONG_BODIES,
        WRONGS as WRONGS,
        wrong_model as wrong_model,
    )

_PUBLIC = {
    "any_body": ("ANY_BODIES", "BODY_BUILDING_SEEDS", "BODY_REPORTED_SEEDS", "FILED_BODIES", "any_body", "filed_body"),
    "bodies": ("Mesh", "blob", "blob_normals", "cylinder", "joined", "sphere_mesh", "tube"),
    "curved_bodies": ("CURVED_BODIES", "SAMPLINGS", "CurvedBody", "curved_body"),
    "drawn_kinds": ("DRAWN_KINDS",),
    "exploring": ("BENCH_TIP_RADIUS", "BenchScene", "SCENES"),
    "kinds": ("BODIES_BY_KIND", "INSPECTED_HALF_SIDE", "MIDDLE"),
    "laid_on": ("Detail", "drawn_details", "laid_on"),
    "long_log": ("write_long_log",),
    "neighbours": ("CLASSIFIED", "classified_body"),
    "noise": ("SAMPLE_SPACING", "simulate_noise"),
    "plate_sweeps": ("DIAMETER", "HALF", "Heights", "TIP_RADIUS", "features", "plate", "scaled", "sweeps", "wire"),
    "sections": (
        "FIRST_BUILT_WITH",
        "SECTION_BODIES",
        "SECTION_NOISES",
        "SECTION_TIP",
        "TRUE_FAMILIES",
        "dilated",
        "section_body",
        "section_trace",
    ),
    "shapes": ("FeltShape", "FELT_SHAPES", "SHAPE_PITCH", "felt_shape", "resampled"),
    "wrong_models": ("REPORTED", "WRONGS", "WRONG_BODIES", "wrong_model"),
}
doorway(__name__, _PUBLIC)
