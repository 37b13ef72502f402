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
 *     dd_mesh mesh = {positions, vertex_count, triangles, triangle_count};
 *     dd_progress progress = {.struct_size = sizeof progress};
 *     dd_job* job;
 *     dd_deformer* deformer;
 *     dd_bind_start(&mesh, roles, vertex_count, handle_count, NULL, &job);
 *     while (dd_job_poll(job, &progress) == DD_OK && progress.state == DD_JOB_RUNNING)
 *       ...show the progress, wait a little...
 *     dd_job_take_deformer(job, &deformer);
 *     dd_job_free(job);
 *     dd_deformer_update(deformer, matrices, handle_count, NULL, out, vertex_count);
 *     dd_deformer_free(deformer);
 *
 * Errors
 *   Functions that can fail return a dd_status. On anything but DD_OK, dd_last_message() gives one
 *   sentence that says what is wrong, where, and what to do. Outputs are written only on DD_OK.
 *   No C++ exception leaves the library and no input makes it abort.
 *
 * Arrays
 *   All arrays belong to the caller and are only read or written during the call; a call that
 *   starts a job copies its inputs. Every array comes with its count, which is checked. A count is
 *   one of things, not of numbers: of vertices for positions (three numbers each, x y z) and roles,
 *   of triangles (three vertex numbers each, counter-clockwise seen from outside), of handles for
 *   matrices (twelve numbers each), of pairs (two numbers each). Vertices, triangles and handles
 *   are numbered from 0. An array that is optional is left out as a null pointer with a count of 0.
 *
 * Structs
 *   struct_size is set by the caller, to the size of the struct as the caller knows it; as many
 *   bytes as both sides know are read or written. Zero is the default of every option, so that
 *   {.struct_size = sizeof options} and a null pointer both stand for all defaults. dd_mesh and
 *   dd_tet_mesh stay as they are for good and need no size.
 *
 * Ownership
 *   An object that a call returns as a pointer (dd_job, dd_deformer, dd_draft, dd_transfer,
 *   dd_match, dd_tets) belongs to the caller and is released by its _free function, which allows
 *   null.
 *
 * Threads
 *   Different objects may be used by different threads at the same time. One object is used by one
 *   thread at a time; a call that finds its deformer, draft or transfer in use returns
 *   DD_ERROR_BUSY.
 *   Jobs work in threads of their own, which never call back.
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
#define DD_ABI_VERSION 3

/* What a call returns. The values are fixed for good; new ones are only added. */
enum dd_status {
  DD_OK = 0,
  DD_ERROR_ARGUMENT = 1,  /* a null pointer, a wrong count, an unknown option value */
  DD_ERROR_MESH = 2,      /* the mesh itself can't be used: names the vertex or triangle */
  DD_ERROR_REGION = 3,    /* nothing is free, nothing holds it, or a handle is empty */
  DD_ERROR_NUMERIC = 4,   /* a system could not be factored, or a result is not finite */
  DD_ERROR_MEMORY = 5,    /* there is no room for the data, or for another thread */
  DD_ERROR_CANCELLED = 6, /* dd_job_cancel was called */
  DD_ERROR_BUSY = 7,      /* another thread or a job is using this object */
  DD_ERROR_INTERNAL = 8
};

/* ---- What all share ---- */

/* A triangle mesh. */
typedef struct dd_mesh {
  const float* positions; /* of the vertices */
  size_t vertex_count;
  const int32_t* triangles; /* their corners */
  size_t triangle_count;
} dd_mesh;

/* The role of a vertex: the number of the handle that moves it, or one of these. */
enum dd_role { DD_ROLE_FREE = -1, DD_ROLE_FIXED = -2 };

/* For counts whose zero is a default other than none. */
enum dd_count { DD_NONE = -1 };

/* What is carried from triangle to triangle. */
enum dd_gradients {
  DD_GRADIENTS_ROTATIONS = 0, /* the rotations of the deformation gradients S_j, by polar
                                 decomposition: details keep their size */
  DD_GRADIENTS_WHOLE = 1      /* S_j as they are: details are stretched along */
};

/* What a result is written as. */
enum dd_values {
  DD_VALUES_POSITIONS = 0,
  DD_VALUES_OFFSETS = 1 /* the deformed minus the rest position */
};

/* How a surface is solved for, given its deformation gradients. */
enum dd_formulation {
  DD_FORMULATION_SURFACE = 0,       /* (14): a row a vertex */
  DD_FORMULATION_FOURTH_POINTS = 1, /* the original (10), weighted by volumes: a row a vertex and a
                                       triangle; needs triangles with area */
  DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED = 2 /* (10) as it stands */
};

/* What a frame works with. The factor is computed in double precision in any case. */
enum dd_precision {
  DD_PRECISION_SINGLE = 0, /* the factor and what is constant of each triangle are kept in single
                              precision, which halves what a frame reads: results are within 1e-5
                              of the box of those in double. Where the mesh doesn't allow it, a
                              step of iterative refinement or double precision is taken */
  DD_PRECISION_DOUBLE = 1
};

/* The ABI of the library that was loaded; compare with DD_ABI_VERSION before anything else. */
DD_API int32_t dd_abi_version(void);

/* The library's version, "major.minor.patch". Static text. */
DD_API const char* dd_version(void);

/* The instruction set the per-frame kernels use on this machine: "avx2" or "baseline". */
DD_API const char* dd_instruction_set(void);

/* One sentence about the last call of this thread that did not return DD_OK. It is valid until the
 * thread's next call. UTF-8. */
DD_API const char* dd_last_message(void);

/* ---- Jobs ----
 *
 * What takes long is a job: a bind, an update of a deformer, a transfer, or a match. It is started
 * by a call that returns at once, and works in a thread of the library. What can be seen to be
 * wrong at once is refused by that call, the rest where the job ends. */

typedef struct dd_job dd_job;
typedef struct dd_deformer dd_deformer; /* a bound surface */
typedef struct dd_transfer dd_transfer; /* a source and a target, factored */
typedef struct dd_match dd_match;       /* correspondences that were found */

enum dd_job_state { DD_JOB_RUNNING = 0, DD_JOB_DONE = 1, DD_JOB_FAILED = 2 };

typedef struct dd_progress {
  uint32_t struct_size;
  int32_t state;     /* dd_job_state */
  double fraction;   /* 0 .. 1; it never falls */
  const char* stage; /* what is being done, static text */
} dd_progress;

/* Tells how far a job is; doesn't wait. */
DD_API int32_t dd_job_poll(const dd_job* job, dd_progress* progress);

/* Asks a job to stop; doesn't wait. The job stops at its next stage, or soon in a factorization or
 * in a search, and ends with DD_ERROR_CANCELLED unless it was complete already. */
DD_API int32_t dd_job_cancel(dd_job* job);

/* Waits for a job to end, and returns the status of its work with its sentence. It may be called
 * any number of times. */
DD_API int32_t dd_job_finish(dd_job* job);

/* These wait as dd_job_finish does, and return its status where that is not DD_OK. Then what the
 * job made becomes the caller's; a second call returns DD_ERROR_ARGUMENT, and so does one of
 * another kind than the job's. The job itself is still to be released. */
DD_API int32_t dd_job_take_deformer(dd_job* job, dd_deformer** deformer);
DD_API int32_t dd_job_take_transfer(dd_job* job, dd_transfer** transfer);
DD_API int32_t dd_job_take_match(dd_job* job, dd_match** match);

/* The vertices that the sentence of a failed job is about, all of them where it names one; none
 * where the job did not fail, or the sentence is about something else. Waits as dd_job_finish does.
 *   out            room for capacity vertices; null with a capacity of 0
 *   vertex_count   how many there are */
DD_API int32_t dd_job_get_vertices(dd_job* job, int32_t* out, size_t capacity,
                                   size_t* vertex_count);

/* Releases a job; one that still runs is cancelled and waited for. */
DD_API void dd_job_free(dd_job* job);

/* ---- Binding ---- */

/* The geometry on which the energy that deforms the base surface is built. */
enum dd_base_metric {
  DD_METRIC_SURFACE = 0, /* the surface S: rigid and affine motions are exact, one factor */
  DD_METRIC_BASE = 1     /* the base surface B, as the paper's text has it */
};

/* The order of that energy: what the base keeps small, and how it meets its border. */
enum dd_smoothness {
  DD_SMOOTHNESS_DEFAULT = 0,            /* thin plate */
  DD_SMOOTHNESS_MEMBRANE = 1,           /* area; meets its border with a crease */
  DD_SMOOTHNESS_THIN_PLATE = 2,         /* curvature; the paper's */
  DD_SMOOTHNESS_CURVATURE_VARIATION = 3 /* change of curvature */
};

/* The triangles that a surface is measured by, and by which it carries gradients. The shape is that
 * of the mesh in any case. */
enum dd_triangulation {
  DD_TRIANGULATION_DELAUNAY = 0, /* where the mesh's are obtuse, others of the same vertices, whose
                                    edges run straight over the faces (intrinsic Delaunay): how
                                    faces were cut into triangles hardly matters */
  DD_TRIANGULATION_GIVEN = 1     /* the mesh's own, as in the paper's text */
};

typedef struct dd_bind_options {
  uint32_t struct_size;
  int32_t base_metric;     /* dd_base_metric */
  double metric_smoothing; /* >= 0, in mean edge lengths: S is faired so far before the energy is
                              built on it (only with DD_METRIC_SURFACE); sensible up to 4 */
  int32_t smoothness;      /* dd_smoothness */
  int32_t precision;       /* dd_precision */
  int32_t threads;         /* how many the bind and each update may use, the caller's among them;
                              0 stands for as many as the machine has, at most 8. Results don't
                              depend on it */
  const float* base; /* B at rest from outside, as positions: then handle_count may be 0, free parts
                        that nothing holds are carried by their base, and base_metric,
                        metric_smoothing and smoothness have no meaning. Null: B is computed */
  size_t base_count; /* vertices: as many as the mesh's, unless there are base_triangles */
  const float* examples; /* of DD_METHOD_EXAMPLES: poses of S, the positions of one after those of
                            the other. They matter to nothing else and cost nothing before that
                            method is used. An example's translation doesn't matter, its rotation
                            does */
  size_t example_count;  /* poses, at most 1000 */
  size_t example_vertex_count; /* vertices of each: as many as the mesh's */
  /* Null: the base has the mesh's own vertices and triangles. Else it is a mesh of its own, a cage
   * or a coarser or finer copy, with three vertices for each of these: each vertex of the mesh
   * follows the nearest point of it, with a rotation that is continuous across its edges. */
  const int32_t* base_triangles;
  size_t base_triangle_count; /* triangles */
  int32_t triangulation;      /* dd_triangulation */
  int32_t draft; /* 1: what dd_job_take_draft gives is made beside the bind. 0: there is none */
} dd_bind_options;

/* Starts to bind: a job that makes a dd_deformer.
 *   mesh           the surface S
 *   roles          role_count values, one a vertex: a dd_role, or a handle below handle_count
 *   handle_count   >= 1 unless a base is given; each handle has at least one vertex */
DD_API int32_t dd_bind_start(const dd_mesh* mesh, const int32_t* roles, size_t role_count,
                             int32_t handle_count, const dd_bind_options* options, dd_job** job);

/* ---- Updating ---- */

/* How the surface follows its handles. */
enum dd_method {
  DD_METHOD_TRANSFER = 0,    /* the paper's: a smooth base bends, details turn with it */
  DD_METHOD_VARIATIONAL = 1, /* the smoothest displacement: details are moved, not turned */
  DD_METHOD_NORMAL = 2,      /* a smooth base bends, details stand on it along its normals */
  DD_METHOD_GRADIENT = 3,    /* the handles' rotation and scale spread over the surface; what a
                                handle is merely moved by turns nothing */
  DD_METHOD_VOLUMES = 4,     /* details keep their volume over the base; slow: dd_update_start */
  DD_METHOD_EXAMPLES = 5     /* posing by example: the blend of the examples given at the bind that
                                fits the handles best. T_j(w) = exp(sum_i w_i log R_ij)
                                (I + sum_i w_i (U_ij - I)), S_ij = R_ij U_ij by (15) from S to
                                example i, in L p' = div(G T^T) (4), over all w and p' at once.
                                Without examples: p' = L^-1 div(G). In one step only */
};

/* The surface that an update returns. */
enum dd_output {
  DD_OUTPUT_RESULT = 0, /* S' */
  DD_OUTPUT_BASE = 1    /* B' in its place */
};

/* How the handles move a computed base. */
enum dd_base_deformer {
  DD_BASE_DEFORMER_AUTOMATIC = 0, /* linear where no handle turns by more than 135 degrees against
                                     another or what is fixed, motions from 180 on, a mean of both
                                     in between */
  DD_BASE_DEFORMER_LINEAR = 1,    /* the paper's: the smoothest displacement. Stretches least, but
                                     collapses towards half a turn and knows no more */
  DD_BASE_DEFORMER_MOTIONS = 2    /* blends the handles' rotations by harmonic weights: even twists
                                     and arcs, of any number of turns */
};

/* What turns a handle. */
enum dd_handle_turns {
  DD_HANDLE_TURNS_TARGET = 0, /* its matrix */
  DD_HANDLE_TURNS_FREE = 1 /* the surface around it: its matrix only places its pivot, its shape is
                                 kept, and its rotation is the one that strains the base least.
                                 A limb pulled by its hand needs no twist of the wrist so. Pushed
                                 straight together it buckles to a side, as a limb does */
};

typedef struct dd_update_options {
  uint32_t struct_size;
  int32_t method;    /* dd_method */
  int32_t gradients; /* dd_gradients. Of no meaning to DD_METHOD_VARIATIONAL. By
                        DD_METHOD_EXAMPLES: of each S_ij; examples with stretches are met with
                        DD_GRADIENTS_WHOLE only */
  int32_t refine;    /* of DD_METHOD_TRANSFER with DD_GRADIENTS_ROTATIONS: iterations, each of which
                        takes the rotations anew from S to S', smooths them over a length
                        (rotation_smoothing) and solves again; 0 stands for 4, DD_NONE for the
                        paper's linear result. On a surface of 10,000 free vertices and more that
                        is dense for that length they run on a coarse one, but for the last solve.
                        Of DD_METHOD_EXAMPLES: the same from the pose that the examples make to
                        where the handles are, which so turns their details as transfer does;
                        DD_NONE: what the handles ask for beyond the examples is spread evenly */
  int32_t output;    /* dd_output */
  int32_t values;    /* dd_values */
  int32_t levels;    /* of DD_METHOD_NORMAL, at most 20: surfaces from S to B, each displaced from
                        the next smoother one; 0 stands for 1 */
  int32_t formulation; /* dd_formulation, of DD_METHOD_TRANSFER; only the surface's is refined */
  const float* base;   /* B', as positions, where the bind was given a base; else null */
  size_t base_count;   /* vertices */
  double volume_tolerance; /* of DD_METHOD_VOLUMES, >= 0: it stops when no vertex moves by more than
                              this in a step, in mean heights of the details; 0 stands for 0.01 */
  int32_t volume_iterations; /* of DD_METHOD_VOLUMES: steps after which it stops anyway; 0 stands
                                for 50 */
  int32_t steps;             /* at most 1000: a large motion is cut into so many (§6), all handles
                                along their screw motions in step, and after each the surface is
                                bound anew to its result; 0 stands for 1. More than one is slow (see
                                dd_update_start), and not for a base from outside */
  const double* turns; /* of a base that blends motions, and of steps: for each handle a rotation
                          vector (an axis times radians), as far as it has turned, so that this may
                          be more than half a turn. It need not be exact: what is missing to the
                          motion's rotation is taken the shortest way. Null: all of it */
  size_t turn_count;   /* handles */
  const double* example_weights; /* of DD_METHOD_EXAMPLES: the pose of these weights, w, is shown
                                    and the handles are let go, 1 being an example, 0 the rest;
                                    parts that nothing fixes go where the examples' centres take
                                    them. Null: the weights that fit the handles */
  size_t example_weight_count;   /* examples */
  double example_stiffness; /* of DD_METHOD_EXAMPLES, >= 0: a factor on what keeps weights near a
                               guess from the handles' places and within 0 to 1; 0 stands for 1 */
  double rim_smoothing;     /* of DD_METHOD_TRANSFER with DD_GRADIENTS_ROTATIONS on the surface, and
                                of DD_METHOD_EXAMPLES where that is refined: a length, as a share
                                of the square root of the deforming area, at most 1. So far from
                                handles and fixed parts, and somewhat farther, the slope has a say
                                as well as the place, (L + L W L) p' = (1 + L W) div(S), so that no
                                crease runs around them and no single vertex stands on a spike. 0
                                stands for 0.05, DD_NONE for none: (14) as it stands */
  double rotation_smoothing; /* of refine: the length over which an iteration smooths the rotations,
                                as a share of the square root of the deforming area, at most 1; the
                                result is the same at any density. Shorter bends more sharply and
                                may fold, thick shapes sooner; longer is stiffer. 0 stands for
                                0.009 */
  int32_t base_deformer;     /* dd_base_deformer. The farther handles turn, the less they are
                                refined: wholly up to 135 degrees, by 0.7 at half a turn, not at all
                                from 630 degrees on. It would pinch the inside of a bend and wring
                                a twist to a thread */
  const int32_t* handle_turns; /* a dd_handle_turns for each handle; null: all by their matrices. By
                                  DD_METHOD_EXAMPLES a free handle's vertices go as the examples do,
                                  and their mean is placed */
  size_t handle_turn_count;    /* handles */
  const double* pivots;        /* of free handles: three numbers for each handle, the point at rest
                                  that its matrix places, not beyond 1e9 of the mesh's size; null:
                                  the mean of its vertices */
  size_t pivot_count;          /* handles */
  const double* example_limits; /* of DD_METHOD_EXAMPLES: the least and the largest weight that is
                                   found for each example, 0 or less and 0 or more, perhaps
                                   infinite; null: any */
  size_t example_limit_count;   /* examples */
} dd_update_options;

/* Makes one frame. By DD_METHOD_TRANSFER: B' from the handles, its deformation gradients S_j (15),
 * their rotations, and L p' = div(S_j^T) (14) for the free vertices. The first update by a method
 * prepares it, which may take as long as a hundred of its updates.
 *   matrices   for each of matrix_count handles a row-major 3x4 affine matrix that takes the rest
 *              place of its vertices to the present one; null where there is no handle
 *   out        three numbers for each of out_count vertices
 * Matrices that are not finite are refused, and so is a result that is not finite or leaves the
 * range of floats. */
DD_API int32_t dd_deformer_update(dd_deformer* deformer, const double* matrices,
                                  size_t matrix_count, const dd_update_options* options, float* out,
                                  size_t out_count);

/* Starts an update as a job, the way to use what is slow: steps, and DD_METHOD_VOLUMES. The job
 * keeps the deformer alive, which may be freed meanwhile. It has the deformer in use during the
 * first step; the later ones work on surfaces of their own. */
DD_API int32_t dd_update_start(dd_deformer* deformer, const double* matrices, size_t matrix_count,
                               const dd_update_options* options, dd_job** job);

/* Facts about an update that was a job. */
typedef struct dd_update_info {
  uint32_t struct_size;
  int32_t volumes_converged; /* 0: DD_METHOD_VOLUMES stopped at its limit of iterations */
  double volume_error;       /* of DD_METHOD_VOLUMES: what the volumes differ by from those at rest,
                              summed, over their sum */
} dd_update_info;

/* What such a job found; they wait as dd_job_finish does, and may be called any number of times.
 *   out   three numbers for each of out_count vertices, as options.values says */
DD_API int32_t dd_job_get_update(dd_job* job, float* out, size_t out_count);
DD_API int32_t dd_job_get_update_info(dd_job* job, dd_update_info* info);

/* What a bind that takes long shows before it is done, made in a fraction of the time: some ten
 * thousand of the vertices, bound by themselves, carry the others. Handles are met exactly and rest
 * is rest; between them it differs from the result by about what another density of the mesh would
 * change. */
typedef struct dd_draft dd_draft;

/* Takes the draft of a bind. Null where it is not there yet, was taken before or isn't made:
 * with a base from outside, and where the mesh has too few vertices for one. Does not wait, and may
 * be called while another thread uses the job. */
DD_API int32_t dd_job_take_draft(dd_job* job, dd_draft** draft);

/* One frame of it, as of dd_deformer_update(), by any method but DD_METHOD_EXAMPLES. Steps are
 * taken as one. */
DD_API int32_t dd_draft_update(dd_draft* draft, const double* matrices, size_t matrix_count,
                               const dd_update_options* options, float* out, size_t out_count);

DD_API void dd_draft_free(dd_draft* draft);

/* Facts about a bound surface. Indices are -1 where there is none. */
typedef struct dd_deformer_info {
  uint32_t struct_size;
  int32_t vertex_count;
  int32_t triangle_count;
  int32_t handle_count;
  int32_t free_count;    /* vertices that are solved for */
  int32_t resting_count; /* vertices in the region that no handle reaches: they stay at rest */
  int32_t
      resting_component_count; /* loose parts these belong to, parts without faces not counted */
  int32_t resting_example;     /* one of the vertices */
  int32_t loose_count;         /* free vertices without a face: they stay at rest */
  int32_t loose_example;       /* one of them */
  int32_t degenerate_count;    /* triangles without a usable area, given a tiny one */
  int32_t degenerate_example;  /* one of them */
  int32_t idle_handle_count;   /* handles without a free vertex beside them: they move their own
                                 vertices and nothing follows */
  int32_t idle_handle_example; /* one of them */
  int32_t stand_in_count; /* triangles whose base has no area: they turn with a neighbour or with
                             their handle; 0 before the first update by DD_METHOD_TRANSFER */
  int32_t unrepresented_count;   /* vertices where S is no height field over the next smoother
                                    surface, summed over the levels of DD_METHOD_NORMAL: there it
                                    fails; 0 before its first update */
  int32_t unrepresented_example; /* one of them */
  double bind_seconds;           /* what the bind took */
  double bytes;                  /* memory that the deformer holds */
  int32_t far_count;   /* vertices farther from a base of its own topology than a tenth of its size:
                           what they follow is a guess */
  int32_t far_example; /* one of them */
  int32_t torn_count;  /* vertices between parts of such a base, whose nearest point and that of a
                           neighbour lie far apart: they may follow different parts of it */
  int32_t torn_example;       /* one of them */
  int32_t proxy_vertex_count; /* vertices of a base of its own topology; 0 where there is none */
  int32_t
      coarse_vertex_count; /* vertices of the coarse surface on which refine finds its rotations;
                                  0 where there is none, or no refined update by
                                  DD_METHOD_TRANSFER yet */
} dd_deformer_info;

DD_API int32_t dd_deformer_get_info(const dd_deformer* deformer, dd_deformer_info* info);

/* What dd_deformer_info counts, and names one of. */
enum dd_finding {
  DD_FINDING_RESTING = 0,
  DD_FINDING_LOOSE = 1,
  DD_FINDING_DEGENERATE = 2, /* the corners of these triangles */
  DD_FINDING_UNREPRESENTED = 3,
  DD_FINDING_FAR = 4,
  DD_FINDING_TORN = 5
};

/* All vertices of a finding, each once.
 *   finding        dd_finding
 *   out            room for capacity vertices; null with a capacity of 0
 *   vertex_count   how many there are */
DD_API int32_t dd_deformer_get_vertices(const dd_deformer* deformer, int32_t finding, int32_t* out,
                                        size_t capacity, size_t* vertex_count);

/* The weights of the last update by DD_METHOD_EXAMPLES, found or given; zeros before it.
 *   out   a number for each of out_count examples */
DD_API int32_t dd_deformer_get_example_weights(const dd_deformer* deformer, double* out,
                                               size_t out_count);

DD_API void dd_deformer_free(dd_deformer* deformer);

/* ---- Deformation transfer between meshes (§3, §5) ----
 *
 *   dd_transfer_start(&source, &target, pairs, pair_count, NULL, &job);
 *   dd_job_take_transfer(job, &transfer);
 *   dd_job_free(job);
 *   dd_transfer_apply(transfer, pose, source.vertex_count, NULL, out, target.vertex_count);
 *   ...the same for each further pose...
 *   dd_transfer_free(transfer);
 *
 * Meshes whose correspondences aren't known are matched first: see dd_match_start. */

/* What pairs are of. */
enum dd_pairs_of {
  DD_PAIRS_OF_TRIANGLES = 0,
  DD_PAIRS_OF_VERTICES = 1, /* a triangle's sources are those with the most corners paired with its
                               own */
  DD_PAIRS_OF_NEAREST = 2   /* none are given: the target is worn by the source, as a garment by a
                               body, and follows what it lies over as both stand, by the placement
                               if one is given */
};

/* What decides where a transferred pose is: gradients leave the place of each loose part open. */
enum dd_anchor {
  DD_ANCHOR_SOURCE = 0,   /* every part moves along with its source */
  DD_ANCHOR_CENTROID = 1, /* the centre of the surface stays */
  DD_ANCHOR_VERTICES = 2, /* the mean of the anchors stays, or goes to the mean of given places */
  DD_ANCHOR_PINNED = 3    /* each anchor stays, or goes to its given place */
};

/* What goes where its source went: gradients leave places open. */
enum dd_placing {
  DD_PLACING_VERTICES = 0,   /* each loose part, and within it each vertex as far as the shapes are
                                alike, or with DD_PAIRS_OF_NEAREST as it lies close, kept outside of
                                the source: beyond the paper. With whole gradients, in parts that
                                nothing pins; else as the next */
  DD_PLACING_COMPONENTS = 1, /* each loose part as a whole; within it the gradients alone decide */
  DD_PLACING_PARTS = 2,      /* each loose part that nothing pins as a whole, which keeps its shape,
                                as buttons, armour and glasses do */
  DD_PLACING_DISPLACEMENTS = 3 /* with whole gradients, in parts that nothing pins: each vertex as
                                far as its source, in proportion to the meshes' sizes where these
                                differ by more than a fifth, and not where by less than a tenth:
                                for shape keys in a family of shapes. Beyond the paper */
};

typedef struct dd_transfer_options {
  uint32_t struct_size;
  int32_t pairs_of;       /* dd_pairs_of */
  int32_t formulation;    /* dd_formulation: (14), n unknowns, or the original (10), n + m */
  int32_t anchor;         /* dd_anchor */
  const int32_t* anchors; /* vertices of the target, for DD_ANCHOR_VERTICES and DD_ANCHOR_PINNED */
  size_t anchor_count;
  const double* placement; /* twelve numbers, a row-major 3x4 matrix: the rotation or reflection,
                              scale and shift that takes the source onto the target; deformations
                              are turned with it. Null: as the pairs say, exact where the target
                              is a moved and scaled copy or its image; else a few degrees count
                              as a difference of shape */
  int32_t precision;       /* dd_precision, of the system */
  int32_t threads;         /* as of dd_bind_options */
  int32_t placing;         /* dd_placing */
  double gap;              /* with DD_PAIRS_OF_NEAREST and DD_PLACING_VERTICES: the target is kept
                              so far outside of the source, as a share of its box, or three quarters
                              as far as it is at rest where that is less. Where most of it is inside
                              at rest, it is kept there. 0 stands for 0.005; negative: it may go
                              through */
  const int32_t* point_triangles; /* for each vertex of the target the triangle of the source in
                                     which its point is, as dd_match_get_points() gives them: they
                                     tell places more exactly than pairs. Null, with
                                     point_weights, or -1: as the pairs say. Not with
                                     DD_PAIRS_OF_NEAREST */
  size_t point_triangle_count;    /* vertices of the target */
  const float* point_weights; /* three numbers for each: of the triangle's corners, 1 together */
  size_t point_weight_count;  /* vertices of the target */
} dd_transfer_options;

/* Starts to factor the target's system: a job that makes a dd_transfer.
 *   pairs   pair_count pairs of numbers, source and target; a target's triangle may have none, one
 *           or many sources, which are averaged. Null: the meshes are of the same topology, each
 *           triangle its own source, or with DD_PAIRS_OF_NEAREST they are found */
DD_API int32_t dd_transfer_start(const dd_mesh* source, const dd_mesh* target, const int32_t* pairs,
                                 size_t pair_count, const dd_transfer_options* options,
                                 dd_job** job);

typedef struct dd_apply_options {
  uint32_t struct_size;
  int32_t gradients;   /* dd_gradients */
  int32_t values;      /* dd_values */
  const float* places; /* where the anchors go, as positions. Null: they stay */
  size_t place_count;  /* anchors */
} dd_apply_options;

/* Transfers one pose: the target is deformed as the source is, by (15) and (14) or (10), and one
 * back-substitution.
 *   pose   positions of the pose_count vertices of the source: S'
 *   out    three numbers for each of the out_count vertices of the target: T' */
DD_API int32_t dd_transfer_apply(dd_transfer* transfer, const float* pose, size_t pose_count,
                                 const dd_apply_options* options, float* out, size_t out_count);

/* Facts about a transfer. Indices are -1 where there is none. */
typedef struct dd_transfer_info {
  uint32_t struct_size;
  int32_t unmatched_count;   /* triangles of the target without a source: they go with the nearest
                                that has one over the surface */
  int32_t unmatched_example; /* one of them */
  int32_t unmatched_component_count; /* loose parts of the target none of whose triangles has one */
  int32_t unmatched_component_example; /* a vertex of one */
  int32_t loose_count;                 /* vertices of the target without a triangle: they stay */
  int32_t degenerate_count;            /* triangles of the target with next to no area */
  int32_t degenerate_example;          /* one of them */
  int32_t mirrored; /* 1: the target corresponds to the source's mirror image, and is deformed as
                           that would be */
  int32_t unknowns; /* rows of the system */
  double nonzeros;  /* of the system */
  double placement[12]; /* a row-major 3x4 matrix: of the source onto the target, with a reflection
                           where that is mirrored */
  int32_t overstretched_count;   /* triangles of the source that correspond to more than eight times
                                  their area, for how large their part is on the target or is
                                  placed there, so that the mean about them stands in for them */
  int32_t overstretched_example; /* the one that corresponds to most */
  int32_t through_count;   /* vertices of a target that is kept outside of its source which are
                              through it at rest: they are kept from going farther */
  int32_t through_example; /* one of them */
  double worn_distance;    /* with DD_PAIRS_OF_NEAREST: of the target's vertices from the source, in
                              the target's unit, on the mean */
} dd_transfer_info;

DD_API int32_t dd_transfer_get_info(const dd_transfer* transfer, dd_transfer_info* info);

DD_API void dd_transfer_free(dd_transfer* transfer);

typedef struct dd_match_options {
  uint32_t struct_size;
  int32_t stages;    /* of growing pull to the target, at most 1000; 0 stands for 8 */
  int32_t rounds;    /* of searching nearest points in each stage, at most 1000; 0 stands for 3 */
  int32_t threads;   /* as of dd_bind_options */
  double smoothness; /* the weight of alike gradients of neighbours; 0 stands for 1 */
  double identity;   /* the weight of gradients near the identity; 0 stands for 0.001 */
  double reach;      /* of the target's box: what is further apart doesn't correspond; 0 stands for
                        0.1 */
  const double* stance; /* or null: how the source stands to the target, beside how their positions
                           have it, as in a scene, 3×4, row-major: a rotation, scale and shift.
                           Where an open part lies on the other so, it corresponds to that. A
                           reflection isn't looked at */
} dd_match_options;

/* Starts to place the source on the target, to deform it onto it (Sumner and Popović 2004) and to
 * look for corresponding triangles: a job that makes a dd_match.
 *   markers   marker_count pairs of vertices, source and target, that must fall on one another: any
 *             number. The source is placed by shape, so that poses, remeshes and akin shapes need
 *             none, and by three markers that are not on a line; what then fits better is taken.
 *             Turns that fit about as well are settled in favour of how the meshes stand, or by a
 *             marker or two. It is mirrored only where four or more that are not in a plane say
 *             so. */
DD_API int32_t dd_match_start(const dd_mesh* source, const dd_mesh* target, const int32_t* markers,
                              size_t marker_count, const dd_match_options* options, dd_job** job);

typedef struct dd_match_info {
  uint32_t struct_size;
  int32_t ambiguous; /* 1: turned otherwise, the source fits about as well; markers settle it */
  double confidence; /* of all triangles of the target, the mean by area, 0 to 1 */
  int32_t mirrored;  /* 1: the markers say that the target is the source's mirror image */
} dd_match_info;

DD_API int32_t dd_match_get_info(const dd_match* match, dd_match_info* info);

/* The source deformed onto the target: positions of the out_count vertices of the source. */
DD_API int32_t dd_match_get_positions(const dd_match* match, float* out, size_t out_count);

/* Pairs of triangles, source and target, as dd_transfer_start takes them.
 *   pairs        room for capacity pairs; null with a capacity of 0
 *   pair_count   how many there are */
DD_API int32_t dd_match_get_pairs(const dd_match* match, int32_t* pairs, size_t capacity,
                                  size_t* pair_count);

/* For each of the vertex_count vertices of the target the point of the source that it corresponds
 * to, as dd_transfer_options takes them.
 *   triangles   of the source; -1 where nothing corresponds
 *   weights     three numbers for each vertex: of the triangle's corners */
DD_API int32_t dd_match_get_points(const dd_match* match, int32_t* triangles, float* weights,
                                   size_t vertex_count);

/* How well each of the out_count triangles of the target is matched, 0 to 1: less where the source
 * lies off it or at an angle, and where it was pulled to several times its length to come there
 * (half is left at three times), which tells a wrong place that fits. */
DD_API int32_t dd_match_get_confidence(const dd_match* match, float* out, size_t out_count);

DD_API void dd_match_free(dd_match* match);

/* ---- Measures and distances ---- */

typedef struct dd_measure_options {
  uint32_t struct_size;
  const float* base; /* B at rest and deformed, as positions: both, or neither */
  size_t base_count; /* vertices */
  const float* deformed_base;
  size_t deformed_base_count;
} dd_measure_options;

/* How a deformed surface compares with the one at rest. Triangles count that have a free corner. */
typedef struct dd_measures {
  uint32_t struct_size;
  int32_t intersecting_pairs; /* pairs of triangles that pass through each other, one counting */
  int32_t new_intersecting_pairs; /* of those, the ones that don't at rest */
  int32_t intersecting_triangles; /* counting triangles in such a pair */
  double stretch;                 /* area-weighted mean of |S_j - R_j| (Frobenius), rest to now */
  double normal_error; /* mean angle in degrees between the triangles' normals and those at rest
                          turned by the base's rotation; 0 without a base */
  double area_ratio;
  double volume_ratio; /* of signed volumes: of use for closed surfaces */
} dd_measures;

/* Measures a deformation. It takes seconds for 100,000 triangles.
 *   mesh       the surface at rest
 *   roles      as for dd_bind_start
 *   deformed   positions of its deformed_count vertices */
DD_API int32_t dd_measure(const dd_mesh* mesh, const int32_t* roles, size_t role_count,
                          const float* deformed, size_t deformed_count,
                          const dd_measure_options* options, dd_measures* measures);

/* The distance over the surface of every vertex from the nearest source, for choosing regions: a
 * few percent too long at most on good meshes; infinite where no path of triangles leads.
 *   sources   source_count values, one a vertex, not 0 for a source
 *   out       a number for each of out_count vertices, in the unit of the positions */
DD_API int32_t dd_distances(const dd_mesh* mesh, const int32_t* sources, size_t source_count,
                            float* out, size_t out_count);

/* The deformation gradients at the vertices, for what is to go along with a deformed surface: of
 * each vertex the mean of (15) over the triangles around it, weighted by their areas at rest. The
 * identity where no triangle has an area.
 *   mesh       the surface at rest
 *   deformed   positions of its deformed_count vertices
 *   out        9 numbers, a 3x3 matrix row by row, for each of out_count vertices */
DD_API int32_t dd_vertex_gradients(const dd_mesh* mesh, const float* deformed,
                                   size_t deformed_count, float* out, size_t out_count);

/* ---- Solids (§4) ----
 *
 * Tetrahedral meshes, in double precision throughout. These calls return when they are done. */

typedef struct dd_tets dd_tets; /* operators of a solid, and its Poisson system, factored */

typedef struct dd_tet_mesh {
  const double* positions; /* of the vertices */
  size_t vertex_count;
  const int32_t* tets; /* four vertex numbers each, of any orientation; each has a volume */
  size_t tet_count;
} dd_tet_mesh;

/* Operators of a solid of n vertices and m tetrahedra. */
enum dd_tet_operator {
  DD_TETS_GRADIENT = 0,             /* G (3), 3m x n, from the faces' normals and heights */
  DD_TETS_DEFORMATION_GRADIENT = 1, /* (9), 3m x n, from V^-1 (6), (8): equal to G */
  DD_TETS_LAPLACIAN = 2             /* G^T D G (4), n x n */
};

/* Makes the operators and factors the Poisson system.
 *   roles          as for dd_bind_start; every connected part has a vertex that is not free
 *   handle_count   may be 0; each handle has at least one vertex */
DD_API int32_t dd_tets_create(const dd_tet_mesh* mesh, const int32_t* roles, size_t role_count,
                              int32_t handle_count, dd_tets** tets);

/* Entries of an operator: the row, column and value of each.
 *   which         dd_tet_operator
 *   rows ...      room for capacity entries in each of the three arrays; null with a capacity of 0
 *   entry_count   how many there are */
DD_API int32_t dd_tets_get_operator(const dd_tets* tets, int32_t which, int32_t* rows,
                                    int32_t* columns, double* values, size_t capacity,
                                    size_t* entry_count);

/* Solves the Poisson system: positions whose gradients are nearest to those wanted, weighted by
 * volume.
 *   constrained   positions of constrained_count vertices, of which those are read that aren't free
 *   gradients     nine numbers for each of gradient_count tetrahedra: S_j, row by row
 *   out           positions of out_count vertices */
DD_API int32_t dd_tets_solve(const dd_tets* tets, const double* constrained,
                             size_t constrained_count, const double* gradients,
                             size_t gradient_count, double* out, size_t out_count);

/* Edits by gradients (§2): rotations and stretches of the handles are spread by harmonic weights,
 * then as dd_tets_solve. matrices: as for dd_deformer_update. */
DD_API int32_t dd_tets_update(const dd_tets* tets, const double* matrices, size_t matrix_count,
                              double* out, size_t out_count);

DD_API void dd_tets_free(dd_tets* tets);

#ifdef __cplusplus
}
#endif

#endif
