"""One triangle and one ball: the closest point, and when a moving ball meets it (closed forms, float64).

Every triangle is given relative to the ball's centre, so nothing here loses digits to a far origin.
Degenerate triangles (a segment, a point) have the normal zero and are right all the same.
"""

from __future__ import annotations

from math import inf, sqrt

from numba import njit

PARALLEL = 1e-15  # cosine below which a ray runs along a plane: rounding alone tilts it by this much


@njit(cache=True, error_model="numpy")
def unit_normal(ax, ay, az, bx, by, bz, cx, cy, cz):  # type: ignore[no-untyped-def]
    """Unit normal of a triangle from its corners, zero where it has no area."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    wx, wy, wz = cx - bx, cy - by, cz - bz
    uu, vv, ww = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    # the two shorter edges give the most accurate cross product
    if uu >= vv and uu >= ww:
        px, py, pz, qx, qy, qz, longest = vx, vy, vz, wx, wy, wz, uu
    elif vv >= ww:
        px, py, pz, qx, qy, qz, longest = ux, uy, uz, wx, wy, wz, vv
    else:
        px, py, pz, qx, qy, qz, longest = ux, uy, uz, vx, vy, vz, ww
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    length = sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 1e-14 * longest:  # narrower than the rounding of its corners: a segment
        return 0.0, 0.0, 0.0
    return nx / length, ny / length, nz / length


@njit(cache=True, error_model="numpy")
def closest_on_segment(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    """Point of the segment ab closest to the origin."""
    ex, ey, ez = bx - ax, by - ay, bz - az
    square = ex * ex + ey * ey + ez * ez
    along = -(ax * ex + ay * ey + az * ez)
    if not along > 0.0 or square == 0.0:
        return ax, ay, az
    if along >= square:
        return bx, by, bz
    u = along / square
    return ax + u * ex, ay + u * ey, az + u * ez


@njit(cache=True, error_model="numpy")
def closest_on_triangle(ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Point of the triangle abc (unit normal n, or zero) closest to the origin.

    The origin's foot on the plane comes first and the edges are judged from there: unlike barycentric
    coordinates from dot products, that holds for triangles 1e-12 times smaller than their distance.
    """
    height = ax * nx + ay * ny + az * nz
    fx, fy, fz = height * nx, height * ny, height * nz
    flat = nx == 0.0 and ny == 0.0 and nz == 0.0
    out_ab = flat or left_of(ax, ay, az, bx, by, bz, fx, fy, fz, nx, ny, nz) < 0.0
    out_bc = flat or left_of(bx, by, bz, cx, cy, cz, fx, fy, fz, nx, ny, nz) < 0.0
    out_ca = flat or left_of(cx, cy, cz, ax, ay, az, fx, fy, fz, nx, ny, nz) < 0.0
    if not (out_ab or out_bc or out_ca):
        return fx, fy, fz
    px, py, pz, best = 0.0, 0.0, 0.0, inf
    if out_ab:
        px, py, pz = closest_on_segment(ax, ay, az, bx, by, bz)
        best = px * px + py * py + pz * pz
    if out_bc:
        qx, qy, qz = closest_on_segment(bx, by, bz, cx, cy, cz)
        square = qx * qx + qy * qy + qz * qz
        if square < best:
            px, py, pz, best = qx, qy, qz, square
    if out_ca:
        qx, qy, qz = closest_on_segment(cx, cy, cz, ax, ay, az)
        square = qx * qx + qy * qy + qz * qz
        if square < best:
            px, py, pz, best = qx, qy, qz, square
    return px, py, pz


@njit(cache=True, error_model="numpy")
def left_of(ax, ay, az, bx, by, bz, fx, fy, fz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """n . ((b - a) x (f - a)): positive if f lies on the inner side of the edge ab."""
    ex, ey, ez = bx - ax, by - ay, bz - az
    wx, wy, wz = fx - ax, fy - ay, fz - az
    return nx * (ey * wz - ez * wy) + ny * (ez * wx - ex * wz) + nz * (ex * wy - ey * wx)


@njit(cache=True, error_model="numpy")
def sweep_vertex(ax, ay, az, dx, dy, dz, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave): when a ball moving from the origin along d overlaps the point a; (inf, -inf) if never."""
    middle = ax * dx + ay * dy + az * dz
    mx, my, mz = ax - middle * dx, ay - middle * dy, az - middle * dz
    lateral = sqrt(mx * mx + my * my + mz * mz)
    if lateral >= radius - graze:
        return inf, -inf
    half = sqrt((radius - lateral) * (radius + lateral))
    return middle - half, middle + half


@njit(cache=True, error_model="numpy")
def sweep_edge(ax, ay, az, bx, by, bz, dx, dy, dz, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave) through the mantle of the cylinder around the open edge ab."""
    ex, ey, ez = bx - ax, by - ay, bz - az
    length = sqrt(ex * ex + ey * ey + ez * ez)
    if length == 0.0:
        return inf, -inf
    ex, ey, ez = ex / length, ey / length, ez / length
    d_along = dx * ex + dy * ey + dz * ez
    px, py, pz = dx - d_along * ex, dy - d_along * ey, dz - d_along * ez
    across = px * px + py * py + pz * pz
    if across == 0.0:
        return inf, -inf
    a_along = ax * ex + ay * ey + az * ez
    qx, qy, qz = ax - a_along * ex, ay - a_along * ey, az - a_along * ez
    middle = (qx * px + qy * py + qz * pz) / across
    mx, my, mz = qx - middle * px, qy - middle * py, qz - middle * pz
    lateral = sqrt(mx * mx + my * my + mz * mz)
    if lateral >= radius - graze:
        return inf, -inf
    half = sqrt((radius - lateral) * (radius + lateral) / across)
    enter, leave = middle - half, middle + half
    if not 0.0 <= enter * d_along - a_along <= length:
        enter = inf
    if not 0.0 <= leave * d_along - a_along <= length:
        leave = -inf
    return enter, leave


@njit(cache=True, error_model="numpy")
def sweep_face(ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz, dx, dy, dz, radius):  # type: ignore[no-untyped-def]
    """(enter, leave) through the two triangles offset by the radius along the normal n and against it."""
    d_normal = dx * nx + dy * ny + dz * nz
    enter, leave = inf, -inf
    if abs(d_normal) <= PARALLEL:
        return enter, leave
    height = ax * nx + ay * ny + az * nz
    for side in (-1.0, 1.0):
        t = (height + side * radius) / d_normal
        fx = t * dx - side * radius * nx
        fy = t * dy - side * radius * ny
        fz = t * dz - side * radius * nz
        if (
            left_of(ax, ay, az, bx, by, bz, fx, fy, fz, nx, ny, nz) >= 0.0
            and left_of(bx, by, bz, cx, cy, cz, fx, fy, fz, nx, ny, nz) >= 0.0
            and left_of(cx, cy, cz, ax, ay, az, fx, fy, fz, nx, ny, nz) >= 0.0
        ):
            enter, leave = min(enter, t), max(leave, t)
    return enter, leave


@njit(cache=True, error_model="numpy")
def sweep_triangle(  # type: ignore[no-untyped-def]
    ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz, dx, dy, dz, radius, graze
):
    """(enter, leave): when a ball moving from the origin along the unit vector d overlaps the triangle.

    The triangle dilated by the ball is convex and bounded by offset faces, cylinders and spheres, so the
    earliest entry and the latest exit through any of them are its own. (inf, -inf) if the ball passes by
    or would sink in by less than `graze`. Times may be negative.
    """
    enter, leave = sweep_face(ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz, dx, dy, dz, radius)
    t, u = sweep_vertex(ax, ay, az, dx, dy, dz, radius, graze)
    enter, leave = min(enter, t), max(leave, u)
    t, u = sweep_vertex(bx, by, bz, dx, dy, dz, radius, graze)
    enter, leave = min(enter, t), max(leave, u)
    t, u = sweep_vertex(cx, cy, cz, dx, dy, dz, radius, graze)
    enter, leave = min(enter, t), max(leave, u)
    t, u = sweep_edge(ax, ay, az, bx, by, bz, dx, dy, dz, radius, graze)
    enter, leave = min(enter, t), max(leave, u)
    t, u = sweep_edge(bx, by, bz, cx, cy, cz, dx, dy, dz, radius, graze)
    enter, leave = min(enter, t), max(leave, u)
    t, u = sweep_edge(cx, cy, cz, ax, ay, az, dx, dy, dz, radius, graze)
    return min(enter, t), max(leave, u)
