"""Plays a motion file with an exported actor, by the C API of libdoppel.so. Needs neither PyTorch nor NumPy.

python3 actor_ctypes.py libdoppel.so ACTOR.pt MOTION.motion OUT.f32
"""
import ctypes
import sys


def load(path: str) -> ctypes.CDLL:
    """The library with the types of the functions used here."""
    library = ctypes.CDLL(path)
    library.doppel_last_error.restype = ctypes.c_char_p
    library.doppel_actor_open.restype = ctypes.c_void_p
    library.doppel_actor_vertices.restype = ctypes.POINTER(ctypes.c_float)
    for name in ("num_vertices", "num_dofs", "vertices", "close"):
        getattr(library, f"doppel_actor_{name}").argtypes = [ctypes.c_void_p]
    library.doppel_actor_push_pose.argtypes = [ctypes.c_void_p, ctypes.POINTER(ctypes.c_float), ctypes.c_int]
    return library


def main() -> None:
    library = load(sys.argv[1])
    actor = library.doppel_actor_open(sys.argv[2].encode())
    if not actor:
        sys.exit(library.doppel_last_error().decode())
    num_dofs, num_vertices = library.doppel_actor_num_dofs(actor), library.doppel_actor_num_vertices(actor)
    with open(sys.argv[3]) as motion, open(sys.argv[4], "wb") as out:
        sign = -1 if "V0.1" in next(motion) else 1  # the old format has angles of the opposite sign
        for row in filter(str.strip, motion):
            pose = [float(number) for number in row.split()[1:]]
            pose[3:] = [sign * angle for angle in pose[3:]]
            if library.doppel_actor_push_pose(actor, (ctypes.c_float * num_dofs)(*pose), len(pose)) != 0:
                sys.exit(library.doppel_last_error().decode())
            out.write(ctypes.string_at(library.doppel_actor_vertices(actor), 12 * num_vertices))
    library.doppel_actor_close(actor)


if __name__ == "__main__":
    main()
