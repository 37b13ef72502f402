/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Detail Deform: detail-preserving surface deformation, after
 *
 *   M. Botsch, R. Sumner, M. Pauly, M. Gross: Deformation Transfer for Detail-Preserving Surface
 *   Editing. Vision, Modeling and Visualization 2006.
 *
 * Equation numbers below are the paper's. This header is the whole interface and its documentation.
 *
 * Use
 *   A triangle mesh and a role for each vertex (free, fixed, or moved by handle k) are bound once;
 *   the deformer then turns handle matrices into vertex positions, many times a second:
 *
 *     dd_bind* bind;
 *     dd_deformer* deformer;
 *     dd_bind_start(positions, 3 * n, triangles, 3 * m, roles, n, handle_count, NULL, &bind);
 *     while (dd_bind_poll(bind, &progress) == DD_OK && progress.state == DD_BIND_RUNNING)
 *       ...show the progress, wait a little...
 *     dd_bind_finish(bind, &deformer);
 *     dd_bind_free(bind);
 *     dd_deformer_update(deformer, matrices, 12 * handle_count, NULL, out, 3 * n);
 *     dd_deformer_free(deformer);
 *
 * Errors
 *   Functions that can fail return a dd_status. On anything but DD_OK, dd_last_message() gives one
 *   sentence that says what is wrong, where, and what to do. Outputs are written only on DD_OK.
 *   No C++ exception leaves the library and no input makes it abort.
 *
 * Ownership
 *   All arrays belong to the caller and are only read or written during the call (dd_bind_start
 *   copies its inputs). Every array comes with its number of elements, which is checked.
 *   What is returned as a pointer (dd_bind, dd_deformer, dd_split, dd_transfer, dd_match) belongs
 *   to the caller and is released by its _free function.
 *
 * Threads
 *   Different objects may be used by different threads at the same time. One object is used by one
 *   thread at a time; an update or a pose that finds its object busy returns DD_ERROR_BUSY.
 *   Binds, splits and matches work in threads of their own, which never call back.
 *
 * Units
 *   Lengths are in the caller's unit throughout; the result does not depend on that unit.
 */
#ifndef DETAIL_DEFORM_H
#define DETAIL_DEFORM_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#if defined(DD_BUILDING)
#define DD_API __declspec(dllexport)
#else
#define DD_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define DD_API __attribute__((visibility("default")))
#else
#define DD_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Grows whenever a caller built against an older header would be misunderstood. */
#define DD_ABI_VERSION 2

/* What a call returns. The values are fixed for good; new ones are only added. */
enum dd_status {
  DD_OK = 0,
  DD_ERROR_ARGUMENT = 1, /* a null pointer, wrong array size, unknown option value */
  DD_ERROR_MESH = 2,     /* the mesh itself can't be used: names the vertex or triangle */
  DD_ERROR_REGION = 3,   /* nothing free, nothing to hold it, an empty handle */
  DD_ERROR_NUMERIC = 4,  /* a system could not be factored, or a result is not finite */
  DD_ERROR_MEMORY = 5,
  DD_ERROR_CANCELLED = 6, /* dd_bind_cancel was called */
  DD_ERROR_BUSY = 7,      /* another thread is using this object */
  DD_ERROR_INTERNAL = 8
};

/* Roles of vertices: a handle's number (0, 1, ...) or one of these. */
enum dd_role { DD_ROLE_FREE = -1, DD_ROLE_FIXED = -2 };

/* How the surface follows its handles. */
enum dd_method {
  DD_METHOD_TRANSFER = 0,    /* the paper's: a smooth base bends, details turn with it */
  DD_METHOD_VARIATIONAL = 1, /* the smoothest displacement: details are moved, not turned */
  DD_METHOD_NORMAL = 2,      /* a smooth base bends, details stand on it along its normals */
  DD_METHOD_GRADIENT = 3,    /* the handles' rotation and scale spread over the surface; what a
                                handle is merely moved by turns nothing */
  DD_METHOD_VOLUMES = 4,     /* details keep their volume over the base; slow: see dd_split_start */
  DD_METHOD_EXAMPLES = 5     /* posing by example: the blend of the examples given at the bind that
                                fits the handles best. T_j(w) = exp(sum_i w_i log R_ij)
                                (I + sum_i w_i (U_ij - I)), S_ij = R_ij U_ij by (15) from S to
                                example i, in L p' = div(G T^T) (4), over all w and p' at once.
                                Without examples: p' = L^-1 div(G). In one step only */
};

/* Geometry on which the energy that deforms the base surface is built. */
enum dd_base_metric {
  DD_METRIC_SURFACE = 0, /* the surface S: rigid and affine motions are exact, one factor */
  DD_METRIC_BASE = 1     /* the base surface B, as the paper's text has it */
};

/* Order of that energy: what the base keeps small, and how it meets its border. */
enum dd_smoothness {
  DD_SMOOTHNESS_DEFAULT = 0,            /* thin plate */
  DD_SMOOTHNESS_MEMBRANE = 1,           /* area; meets its border with a crease */
  DD_SMOOTHNESS_THIN_PLATE = 2,         /* curvature; the paper's */
  DD_SMOOTHNESS_CURVATURE_VARIATION = 3 /* change of curvature */
};

/* How DD_METHOD_TRANSFER solves for the surface with given deformation gradients. */
enum dd_formulation {
  DD_FORMULATION_SURFACE = 0,       /* (14): a row a vertex */
  DD_FORMULATION_FOURTH_POINTS = 1, /* the original (10), weighted by volumes: a row a vertex and a
                                       triangle; needs triangles with area */
  DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED = 2 /* (10) as it stands */
};

/* What an update returns of the surface. */
enum dd_shown {
  DD_SHOWN_RESULT = 0, /* S' */
  DD_SHOWN_BASE = 1    /* B' in its place */
};

enum dd_output {
  DD_OUTPUT_POSITIONS = 0,
  DD_OUTPUT_OFFSETS = 1 /* deformed minus rest position */
};

enum dd_bind_state { DD_BIND_RUNNING = 0, DD_BIND_DONE = 1, DD_BIND_FAILED = 2 };

typedef struct dd_bind dd_bind;         /* a bind under way */
typedef struct dd_deformer dd_deformer; /* a bound surface */
typedef struct dd_split dd_split;       /* a large motion under way in steps */

/* What a frame works with. The factor is computed in double precision in any case. */
typedef enum dd_precision {
  DD_PRECISION_SINGLE = 0, /* the factor and what is constant of each triangle are kept in single
                              precision, which halves what a frame reads: results within 1e-5 of the
                              box of those in double. Where the mesh doesn't allow it, a step of
                              iterative refinement or double precision is taken */
  DD_PRECISION_DOUBLE = 1
} dd_precision;

/* Options of a bind. Set struct_size to sizeof(dd_bind_options) and the rest to what is wanted;
 * zero is every field's default. A null pointer stands for all defaults. */
typedef struct dd_bind_options {
  uint32_t struct_size;
  int32_t base_metric;     /* dd_base_metric */
  double metric_smoothing; /* >= 0, in mean edge lengths: fairing of S before the energy is built on
                              it (only with DD_METRIC_SURFACE); sensible up to 4 */
  int32_t smoothness;      /* dd_smoothness */
  const float* base; /* B at rest from outside, as positions: then handle_count may be 0, free parts
                        that nothing holds are carried by their base, and the fields above have no
                        meaning. Null: B is computed */
  size_t base_count; /* 3 n, or 0 */
  int32_t precision; /* dd_precision */
  int32_t threads;   /* that the bind and each update may use, the caller's among them; 0 stands for
                        as many as the machine has, at most 8. Results don't depend on it */
  const float* examples; /* of DD_METHOD_EXAMPLES: poses of S, the n positions of each, one example
                            after the other; null where there are none. They matter to nothing
                            else and cost nothing before that method is used. An example's
                            translation doesn't matter, its rotation does */
  size_t example_value_count; /* 3 n x example_count */
  int32_t example_count;      /* 0 .. 1000 */
} dd_bind_options;

/* Options of one update. A null pointer stands for the paper's method with rotations only, refined
 * by 4 iterations, as positions: {sizeof(dd_update_options), 1, 0, 0, 4, 0, 1, NULL, 0, 0, 0, 0,
 * NULL, 0, 0}.
 */
typedef struct dd_update_options {
  uint32_t struct_size;
  int32_t rotation_only; /* 1: S_j is replaced by its rotation (polar decomposition); 0: S_j whole.
                            Of no meaning to DD_METHOD_VARIATIONAL. By DD_METHOD_EXAMPLES: of each
                            S_ij; examples with stretches are met with 0 only */
  int32_t output;        /* dd_output */
  int32_t method;        /* dd_method */
  int32_t refine;    /* >= 0: iterations on top of DD_METHOD_TRANSFER with rotation_only, each of
                        which takes the rotations anew from S to S', smooths them over the
                        surface and solves (14) again; 0: the paper's linear result */
  int32_t shown;     /* dd_shown */
  int32_t levels;    /* of DD_METHOD_NORMAL, >= 1: surfaces from S to B, each displaced from the
                        next smoother one; 0 stands for 1 */
  const float* base; /* B', as positions, where the bind was given a base; else null */
  size_t base_count; /* 3 n, or 0 */
  double volume_tolerance; /* of DD_METHOD_VOLUMES, > 0: it stops when no vertex moves by more than
                              this in a step, in mean heights of the details; 0 stands for 0.01 */
  int32_t volume_iterations; /* of DD_METHOD_VOLUMES: steps after which it stops anyway; 0 stands
                                for 50 */
  int32_t formulation;       /* dd_formulation; others than the surface's are not refined */
  const double*
      example_weights;         /* of DD_METHOD_EXAMPLES: the pose of these weights, w, is shown and
                                    the handles are let go, 1 being an example, 0 the rest; parts
                                    that nothing fixes go where the examples' centres take them.
                                    Null: the weights that fit the handles */
  size_t example_weight_count; /* as many as examples, or 0 */
  double example_stiffness;    /* of DD_METHOD_EXAMPLES, >= 0: a factor on what keeps weights near a
                               guess from the handles' places and within 0 to 1; 0 stands for 1 */
} dd_update_options;

typedef struct dd_bind_progress {
  uint32_t struct_size; /* set by the caller */
  int32_t state;        /* dd_bind_state */
  double fraction;      /* 0 .. 1, never falls */
  const char* stage;    /* what is being done, static text */
} dd_bind_progress;

/* Facts about a bound surface. Indices are -1 where there is none. */
typedef struct dd_deformer_info {
  uint32_t struct_size; /* set by the caller */
  int32_t vertex_count;
  int32_t triangle_count;
  int32_t handle_count;
  int32_t free_count;         /* vertices that are solved for */
  int32_t resting_count;      /* vertices in the region that no handle reaches: they stay at rest */
  int32_t resting_part_count; /* loose parts these belong to, parts without faces not counted */
  int32_t resting_example;    /* one of them */
  int32_t loose_count;        /* free vertices without a face: they stay at rest */
  int32_t loose_example;      /* one of them */
  int32_t degenerate_count;   /* triangles without a usable area, given a tiny one */
  int32_t degenerate_example; /* one of them */
  int32_t borrowed_count; /* triangles whose base has no area: they turn with a neighbour or with
                             their handle; 0 before the first update by DD_METHOD_TRANSFER */
  int32_t unrepresented_count;   /* vertices where S is no height field over the next smoother
                                    surface, summed over the levels of DD_METHOD_NORMAL: there it
                                    fails; 0 before its first update */
  int32_t unrepresented_example; /* one of them */
  double bind_seconds;
  double bytes;                /* memory held by the bound deformer */
  int32_t idle_handle_count;   /* handles without a free vertex beside them: they move their own
                                  vertices and nothing follows */
  int32_t idle_handle_example; /* one of them */
} dd_deformer_info;

/* The ABI of the library that was loaded; compare with DD_ABI_VERSION before anything else. */
DD_API int32_t dd_abi_version(void);

/* The library's version, "major.minor.patch". Static text. */
DD_API const char* dd_version(void);

/* The instruction set the per-frame kernels use on this machine: "avx2" or "baseline". */
DD_API const char* dd_instruction_set(void);

/* One sentence about the last call of this thread that did not return DD_OK. Valid until the
 * thread's next call. UTF-8. */
DD_API const char* dd_last_message(void);

/* Starts to bind in a thread of the library and returns at once.
 *   positions       position_count = 3 n floats, x y z of each vertex: the surface S
 *   triangles       triangle_index_count = 3 m vertex numbers, counter-clockwise seen from outside
 *   roles           role_count = n values: dd_role or a handle number below handle_count
 *   handle_count    >= 1 unless a base is given; each handle has at least one vertex
 * What can be seen to be wrong at once is refused here, the rest at dd_bind_finish. */
DD_API int32_t dd_bind_start(const float* positions, size_t position_count,
                             const int32_t* triangles, size_t triangle_index_count,
                             const int32_t* roles, size_t role_count, int32_t handle_count,
                             const dd_bind_options* options, dd_bind** bind);

/* How far a bind is; doesn't wait. */
DD_API int32_t dd_bind_poll(dd_bind* bind, dd_bind_progress* progress);

/* Asks a bind to stop at its next stage or soon in a factorization; doesn't wait. dd_bind_finish then returns
 * DD_ERROR_CANCELLED, unless the bind was complete already. */
DD_API int32_t dd_bind_cancel(dd_bind* bind);

/* Waits for a bind to end. On DD_OK the deformer is the caller's; a second call returns
 * DD_ERROR_ARGUMENT. The dd_bind itself is still to be released. */
DD_API int32_t dd_bind_finish(dd_bind* bind, dd_deformer** deformer);

/* Releases a bind; one that still runs is cancelled and waited for. Null is allowed. */
DD_API void dd_bind_free(dd_bind* bind);

/* One frame. By DD_METHOD_TRANSFER: B' from the handles, its deformation gradients S_j (15), their
 * rotations, and L p' = div(S_j^T) (14) for the free vertices. The first update by a method
 * prepares it, which may take as long as a hundred of its updates.
 *   matrices   matrix_value_count = 12 x handle_count doubles: for each handle a row-major 3x4
 *              affine matrix that takes the rest place of its vertices to the present one; may be
 *              null where there is no handle
 *   out        out_count = 3 n floats, positions or offsets of all vertices
 * Not finite matrices are refused, and so is a result that is not finite or leaves float range. */
DD_API int32_t dd_deformer_update(dd_deformer* deformer, const double* matrices,
                                  size_t matrix_value_count, const dd_update_options* options,
                                  float* out, size_t out_count);

DD_API int32_t dd_deformer_get_info(const dd_deformer* deformer, dd_deformer_info* info);

/* The weights of the last update by DD_METHOD_EXAMPLES, found or given; zeros before it.
 *   out   count doubles, as many as there are examples */
DD_API int32_t dd_deformer_get_example_weights(const dd_deformer* deformer, double* out,
                                               size_t count);

/* Facts about a finished split. */
typedef struct dd_split_info {
  uint32_t struct_size;    /* set by the caller */
  int32_t volumes_settled; /* 0: DD_METHOD_VOLUMES stopped at its iteration limit */
  double volume_error;     /* of DD_METHOD_VOLUMES: sum of what the volumes differ by from those at
                              rest, over their sum */
} dd_split_info;

/* A large motion in steps (§6): the handles' motions are cut along their screw motions, all in step,
 * and after each step the surface is bound anew to its result. Works in a thread of the library and
 * returns at once; one step is what dd_deformer_update gives, and the way to use slow methods.
 * DD_METHOD_EXAMPLES knows one step only.
 *   positions ... options   as for dd_bind_start; with a base from outside steps must be 1
 *   matrices, update        as for dd_deformer_update
 *   turns                   turn_count = 3 x handle_count doubles: a rotation vector for each
 *   handle,
 *                           near which its motion's rotation is taken, so that it may be more than
 *                           half a turn; or null
 *   steps                   1 .. 1000 */
DD_API int32_t dd_split_start(const float* positions, size_t position_count,
                              const int32_t* triangles, size_t triangle_index_count,
                              const int32_t* roles, size_t role_count, int32_t handle_count,
                              const dd_bind_options* options, const double* matrices,
                              size_t matrix_value_count, const double* turns, size_t turn_count,
                              int32_t steps, const dd_update_options* update, dd_split** split);

/* As their namesakes for a bind. dd_split_finish writes out_count = 3 n floats. */
DD_API int32_t dd_split_poll(dd_split* split, dd_bind_progress* progress);
DD_API int32_t dd_split_cancel(dd_split* split);
DD_API int32_t dd_split_finish(dd_split* split, float* out, size_t out_count);
/* After dd_split_finish. */
DD_API int32_t dd_split_get_info(const dd_split* split, dd_split_info* info);
DD_API void dd_split_free(dd_split* split);

/* Releases a deformer. Null is allowed. */
DD_API void dd_deformer_free(dd_deformer* deformer);

/* How a deformed surface compares with the one at rest. Triangles count that have a free corner. */
typedef struct dd_measures {
  uint32_t struct_size;       /* set by the caller */
  int32_t intersecting_pairs; /* pairs of triangles that pass through each other, one counting */
  int32_t new_intersecting_pairs; /* of those, the ones that don't at rest */
  int32_t intersecting_triangles; /* counting triangles in such a pair */
  double stretch;                 /* area-weighted mean of |S_j - R_j| (Frobenius), rest to now */
  double normal_error; /* mean angle in degrees between the triangles' normals and those at
                          rest turned by the base's rotation; 0 without a base */
  double area_ratio;
  double volume_ratio; /* of signed volumes: of use for closed surfaces */
} dd_measures;

/* Measures a deformation. rest, deformed, base, deformed_base: 3 n floats each, the last two may be
 * null; triangles, roles as for dd_bind_start. Takes seconds for 100,000 triangles. */
DD_API int32_t dd_measure(const float* rest, const float* deformed, size_t position_count,
                          const int32_t* triangles, size_t triangle_index_count,
                          const int32_t* roles, size_t role_count, const float* base,
                          const float* deformed_base, dd_measures* measures);

/* The distance over the surface of every vertex from the nearest source, for choosing regions: a few
 * percent too long at most on good meshes; infinite where no path of triangles leads.
 *   positions, triangles   as for dd_bind_start
 *   sources                source_count = n numbers, not 0 for a source
 *   out                    out_count = n floats, in the unit of the positions */
DD_API int32_t dd_distances(const float* positions, size_t position_count, const int32_t* triangles,
                            size_t triangle_index_count, const int32_t* sources,
                            size_t source_count, float* out, size_t out_count);

/* Solids: tetrahedral meshes (§4), in double precision throughout. Synchronous. */
typedef struct dd_tets dd_tets;

/* Operators of a solid, as dd_tets_get_operator numbers them. */
enum dd_tet_operator {
  DD_TETS_GRADIENT = 0,             /* G (3), 3m x n, from the faces' normals and heights */
  DD_TETS_DEFORMATION_GRADIENT = 1, /* (9), 3m x n, from V^-1 (6), (8): equal to G */
  DD_TETS_LAPLACIAN = 2             /* G^T D G (4), n x n */
};

/* Makes operators and factors the Poisson system.
 *   positions   3 n doubles
 *   tets        4 m vertex numbers, of any orientation; each tetrahedron has a volume
 *   roles       n values as for dd_bind_start; every connected part has a constrained vertex */
DD_API int32_t dd_tets_create(const double* positions, size_t position_count, const int32_t* tets,
                              size_t tet_index_count, const int32_t* roles, size_t role_count,
                              int32_t handle_count, dd_tets** result);

/* Entries of an operator: row, column and value of each. capacity: room in the three arrays, which
 * may be null with a capacity of 0; entry_count: how many there are. */
DD_API int32_t dd_tets_get_operator(const dd_tets* tets, int32_t which, int32_t* rows,
                                    int32_t* columns, double* values, size_t capacity,
                                    size_t* entry_count);

/* Poisson: positions whose gradients are nearest to those wanted, weighted by volume.
 *   constrained   3 n doubles, of which those of constrained vertices are read
 *   gradients     9 m doubles: S_j of each tetrahedron, row by row
 *   out           3 n doubles */
DD_API int32_t dd_tets_solve(const dd_tets* tets, const double* constrained,
                             size_t constrained_count, const double* gradients,
                             size_t gradient_value_count, double* out, size_t out_count);

/* Gradient editing (§2): rotations and stretches of the handles spread by harmonic weights, then as
 * dd_tets_solve. matrices as for dd_deformer_update. */
DD_API int32_t dd_tets_update(const dd_tets* tets, const double* matrices,
                              size_t matrix_value_count, double* out, size_t out_count);

DD_API void dd_tets_free(dd_tets* tets);

/* ---- Deformation transfer between meshes (§3, §5) ----
 *
 *   dd_transfer_create(source_positions, 3 * n, source_triangles, 3 * m, target_positions, ...,
 *                      pairs, 2 * pair_count, NULL, &transfer);
 *   dd_transfer_apply(transfer, pose, 3 * n, 1, NULL, 0, out, 3 * target_n);   (for each pose)
 *   dd_transfer_free(transfer);
 *
 * Pairs of meshes whose correspondences aren't known are matched first: dd_match_start. */

typedef struct dd_transfer dd_transfer; /* a source and a target, factored */
typedef struct dd_match dd_match;       /* a search for correspondences under way, or its result */

/* What pairs are of. */
enum dd_pairs_of {
  DD_PAIRS_OF_TRIANGLES = 0,
  DD_PAIRS_OF_VERTICES =
      1 /* a triangle's sources: those with the most corners paired with its own */
};

/* What decides where a transferred pose is: gradients leave the place of each loose part open. */
enum dd_anchor {
  DD_ANCHOR_SOURCE = 0,   /* every part moves along with its source */
  DD_ANCHOR_CENTROID = 1, /* the centre of the surface stays */
  DD_ANCHOR_VERTICES = 2, /* the mean of the anchors stays, or goes to the mean of given places */
  DD_ANCHOR_PINNED = 3    /* each anchor stays, or goes to its given place */
};

/* Zero is every field's default; a null pointer stands for all defaults. */
typedef struct dd_transfer_options {
  uint32_t struct_size;
  int32_t pairs_of;       /* dd_pairs_of */
  int32_t formulation;    /* dd_formulation: (14), n unknowns, or the original (10), n + m */
  int32_t anchor;         /* dd_anchor */
  const int32_t* anchors; /* vertices of the target, for DD_ANCHOR_VERTICES and DD_ANCHOR_PINNED */
  size_t anchor_count;
  const double* placement; /* 12: row-major 3x4, the rotation, scale and shift that takes the source
                               onto the target; deformations are turned with it. Null: as the pairs
                               say, exact where the target is a moved and scaled copy; a rotation of
                               less than 20 degrees between different shapes counts as part of these */
  int32_t precision;       /* dd_precision; of the system. DD_PRECISION_SINGLE for live use */
  int32_t threads;         /* as for dd_bind_options */
} dd_transfer_options;

typedef struct dd_transfer_info {
  uint32_t struct_size;         /* set by the caller */
  int32_t unmatched_count;      /* triangles of the target without a source: they go with the
                                     nearest that has one over the surface */
  int32_t unmatched_example;    /* one of them, or -1 */
  int32_t unmatched_part_count; /* loose parts of the target none of whose triangles has a source */
  int32_t unmatched_part_example; /* a vertex of one, or -1 */
  int32_t loose_count;            /* vertices of the target without a triangle: they stay */
  int32_t degenerate_count;       /* triangles of the target with next to no area */
  int32_t degenerate_example;     /* one of them, or -1 */
  int32_t mirrored;     /* 1: the target corresponds to the source's mirror image, of which
                                     only the nearest rotation is taken */
  int32_t unknowns;     /* rows of the system */
  double nonzeros;      /* of the system */
  double placement[12]; /* row-major 3x4: of the source onto the target */
} dd_transfer_info;

/* Factors the target's system. Positions: 3 floats a vertex, triangles: 3 vertex numbers each, as for
 * dd_bind_start. pairs: pair_value_count = 2 x count numbers, source and target, from 0; a target's
 * triangle may have none, one or many sources, which are averaged. Null and 0: the meshes are of
 * the same topology, each triangle its own source. */
DD_API int32_t dd_transfer_create(const float* source_positions, size_t source_position_count,
                                  const int32_t* source_triangles, size_t source_index_count,
                                  const float* target_positions, size_t target_position_count,
                                  const int32_t* target_triangles, size_t target_index_count,
                                  const int32_t* pairs, size_t pair_value_count,
                                  const dd_transfer_options* options, dd_transfer** transfer);

/* One pose: the target deformed as the source is, by (15) and (14) or (10), and one
 * back-substitution.
 *   pose           pose_count = 3 floats a vertex of the source: S'
 *   rotation_only  1: deformation gradients reduced to their rotations; 0: whole
 *   places         place_count = 3 floats an anchor: where the anchors go; null and 0: they stay
 *   out            out_count = 3 floats a vertex of the target: T' */
DD_API int32_t dd_transfer_apply(dd_transfer* transfer, const float* pose, size_t pose_count,
                                 int32_t rotation_only, const float* places, size_t place_count,
                                 float* out, size_t out_count);

DD_API int32_t dd_transfer_get_info(const dd_transfer* transfer, dd_transfer_info* info);

/* Releases a transfer. Null is allowed. */
DD_API void dd_transfer_free(dd_transfer* transfer);

/* Zero is every field's default; a null pointer stands for all defaults. */
typedef struct dd_match_options {
  uint32_t struct_size;
  int32_t stages;    /* of growing pull to the target; 0 stands for 8 */
  int32_t rounds;    /* of searching nearest points in each stage; 0 stands for 3 */
  int32_t threads;   /* as for dd_bind_options */
  double smoothness; /* weight of alike gradients of neighbours; 0 stands for 1 */
  double identity;   /* weight of gradients near the identity; 0 stands for 0.001 */
  double reach;      /* of the target's box: what is further apart doesn't correspond; 0 stands for
                        0.1 */
} dd_match_options;

/* Starts to deform the source onto the target (Sumner and Popović 2004) and to look for corresponding
 * triangles, in a thread of the library; returns at once.
 *   markers   marker_value_count = 2 x count vertex numbers, source and target, from 0: three
 *             pairs or more that must fall on one another, not on a line */
DD_API int32_t dd_match_start(const float* source_positions, size_t source_position_count,
                              const int32_t* source_triangles, size_t source_index_count,
                              const float* target_positions, size_t target_position_count,
                              const int32_t* target_triangles, size_t target_index_count,
                              const int32_t* markers, size_t marker_value_count,
                              const dd_match_options* options, dd_match** match);
DD_API int32_t dd_match_poll(dd_match* match, dd_bind_progress* progress);
DD_API int32_t dd_match_cancel(dd_match* match);
/* Waits; the status of the search. What follows may then be asked for, any number of times. */
DD_API int32_t dd_match_finish(dd_match* match);
/* The source deformed onto the target: 3 floats a vertex of the source. */
DD_API int32_t dd_match_get_positions(dd_match* match, float* out, size_t out_count);
/* Pairs of triangles, source and target, for dd_transfer_create: their number of values, and, where
 * capacity isn't 0, the values. */
DD_API int32_t dd_match_get_pairs(dd_match* match, int32_t* pairs, size_t capacity,
                                  size_t* value_count);
/* How well each triangle of the target is matched, 0 to 1. */
DD_API int32_t dd_match_get_confidence(dd_match* match, float* out, size_t out_count);
/* Releases a match; one under way is cancelled and waited for. Null is allowed. */
DD_API void dd_match_free(dd_match* match);

#ifdef __cplusplus
}
#endif

#endif
