/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Detail Deform: detail-preserving surface deformation, after
 *
 *   M. Botsch, R. Sumner, M. Pauly, M. Gross: Deformation Transfer for Detail-Preserving Surface
 *   Editing. Vision, Modeling and Visualization 2006.
 *
 * This header is the whole interface. The equations behind it are in native/THEORY.md.
 *
 * Use
 *   A triangle mesh and a role for each vertex (free, fixed, or moved by handle k) are bound once;
 *   the deformer then turns handle matrices into vertex positions, many times a second:
 *
 *     dd_mesh mesh = {{positions, vertex_count, 3 * sizeof(float)}, triangles, triangle_count};
 *     dd_points_out out = {result, vertex_count, 3 * sizeof(float)};
 *     dd_job* job = NULL;
 *     dd_deformer* deformer = NULL;
 *     if (dd_deformer_bind_start(&mesh, roles, vertex_count, handle_count, NULL, &job) != DD_OK ||
 *         dd_job_take_deformer(job, &deformer) != DD_OK ||
 *         dd_deformer_update(deformer, matrices, handle_count, NULL, &out) != DD_OK)
 *       puts(dd_last_message());
 *     dd_job_free(job);
 *     dd_deformer_free(deformer);
 *
 * Options
 *   A null pointer to options stands for all defaults. Otherwise dd_..._options_init() fills a
 *   struct with the defaults, and the caller changes what it wants different. No value stands for
 *   another one: zero means zero. All calls with all defaults give what the Blender add-on gives by
 *   default.
 *
 * Errors
 *   Functions that can fail return a dd_status. On anything but DD_OK, dd_last_error() gives what
 *   is wrong, with what, and what to do, and dd_last_message() the same as English text. Outputs
 *   are written only on DD_OK. No C++ exception leaves the library and no input makes it abort.
 *
 * Arrays
 *   All arrays belong to the caller and are only read or written during the call; a call that
 *   starts a job copies its inputs. An array of vertex positions is a dd_points, which has its
 *   count and its stride. Every other array is followed by its count, which is one of things, not
 *   of numbers: of triangles (three vertex numbers each, counter-clockwise seen from outside), of
 *   handles for matrices (twelve numbers each), of pairs (two numbers each). Vertices, triangles
 *   and handles are numbered from 0. An optional array is left out as a null pointer with a count
 *   of 0.
 *
 * Structs
 *   struct_size is the size of a struct as the caller's header declares it; _init() sets it for
 *   options, the caller for what is filled in by a call. Fields that only one side knows are left
 *   alone, or have their defaults. dd_points, dd_points_out and dd_mesh stay as they are for good
 *   and have no size.
 *
 * Ownership
 *   An object that a call returns as a pointer (dd_job, dd_deformer, dd_draft, dd_riders,
 *   dd_transfer, dd_match) belongs to the caller and is released by its _free function, which
 *   allows null.
 *
 * Threads
 *   Different objects may be used by different threads at the same time. One object is used by one
 *   thread at a time; a call that finds its deformer, draft, riders or transfer in use returns
 *   DD_ERROR_BUSY. Jobs work in threads of their own, which never call back. All objects share one
 *   set of worker threads, which exists as long as any object does.
 *
 * Units
 *   Lengths are in the caller's unit throughout; the result does not depend on that unit.
 */
#ifndef DETAIL_DEFORM_H
#define DETAIL_DEFORM_H

#include <stddef.h>
#include <stdint.h>

#if defined(DD_STATIC)
#define DD_API
#elif defined(_WIN32)
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

/* An enum of 32 bits, in C and in C++. */
#if defined(__cplusplus)
#define DD_ENUM(name) enum name : int32_t
#else
#define DD_ENUM(name)   \
  typedef int32_t name; \
  enum
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Grows whenever a caller built against an older header would be misunderstood. */
#define DD_ABI_VERSION 4

#define DD_VERSION_MAJOR 1
#define DD_VERSION_MINOR 0
#define DD_VERSION_PATCH 0

/* ---- Errors ---- */

/* What a call returns. The values are fixed for good; new ones are only added. */
DD_ENUM(dd_status){
    DD_OK = 0,
    DD_ERROR_ARGUMENT = 1,  /* a null pointer, a wrong count, an unknown option value */
    DD_ERROR_MESH = 2,      /* the mesh itself can't be used */
    DD_ERROR_REGION = 3,    /* nothing is free, nothing holds it, or a handle is empty */
    DD_ERROR_NUMERIC = 4,   /* a system could not be factored, or a result is not finite */
    DD_ERROR_MEMORY = 5,    /* there is no room for the data, or for another thread */
    DD_ERROR_CANCELLED = 6, /* dd_job_cancel was called */
    DD_ERROR_BUSY = 7,      /* another thread or a job is using this object */
    DD_ERROR_INTERNAL = 8,
};

/* What an error is about. */
DD_ENUM(dd_subject){
    DD_SUBJECT_NONE = 0,     /* the call as a whole */
    DD_SUBJECT_VERTEX = 1,   /* of the mesh */
    DD_SUBJECT_TRIANGLE = 2, /* of the mesh */
    DD_SUBJECT_HANDLE = 3,
    DD_SUBJECT_EXAMPLE = 4,
    DD_SUBJECT_PAIR = 5,          /* of a transfer or, as markers, of a match */
    DD_SUBJECT_SOURCE_VERTEX = 6, /* of a transfer's or a match's source */
    DD_SUBJECT_SOURCE_TRIANGLE = 7,
    DD_SUBJECT_TARGET_VERTEX = 8, /* of its target */
    DD_SUBJECT_TARGET_TRIANGLE = 9,
    DD_SUBJECT_BASE_VERTEX = 10, /* of a base from outside */
    DD_SUBJECT_BASE_TRIANGLE = 11,
};

/* What can be done about an error. */
DD_ENUM(dd_remedy){
    DD_REMEDY_NONE = 0,            /* nothing that this library knows of */
    DD_REMEDY_CALL = 1,            /* correct the call */
    DD_REMEDY_WAIT = 2,            /* call again when the object isn't in use */
    DD_REMEDY_FREE_RESOURCES = 3,  /* end other programs, or allow more threads or memory */
    DD_REMEDY_VALIDATE_MESH = 4,   /* correct the indices of the triangles */
    DD_REMEDY_MOVE_VERTEX = 5,     /* move it to a finite place */
    DD_REMEDY_ADD_FACES = 6,       /* the mesh has none */
    DD_REMEDY_DISSOLVE_FACES = 7,  /* dissolve what has no area, or use DD_FORMULATION_SURFACE */
    DD_REMEDY_ADD_HANDLE = 8,      /* add one, with vertices */
    DD_REMEDY_ASSIGN_VERTICES = 9, /* give the handle vertices */
    DD_REMEDY_HANDLE_ON_PART = 10, /* put a handle on the loose part that should deform */
    DD_REMEDY_FREE_VERTICES = 11,  /* let some vertices be free */
    DD_REMEDY_FIX_VERTICES = 12,   /* fix some vertices */
    DD_REMEDY_MOVE_LESS = 13,      /* move the handles, or pose the source, less far */
    DD_REMEDY_SMOOTH_METRIC_LESS = 14, /* lower metric_smoothing */
    DD_REMEDY_SURFACE_METRIC = 15,     /* DD_METRIC_SURFACE, or one more handle that holds it */
    DD_REMEDY_PIN_FEWER = 16,          /* let some vertices of the target be free */
    DD_REMEDY_WHOLE_GRADIENTS = 17,    /* DD_GRADIENTS_WHOLE, or another dd_placing */
    DD_REMEDY_MATCH_MESHES = 18,       /* give pairs, or find them by dd_match_start */
    DD_REMEDY_MOVE_TARGET = 19,        /* bring the target nearer to the source */
    DD_REMEDY_CORRECT_MARKERS = 20,    /* take one of those away that contradict one another */
    DD_REMEDY_SAME_VERTICES = 21,      /* use a copy of the mesh with the same vertices */
};

typedef struct dd_error {
  uint32_t struct_size;
  dd_status status;
  dd_subject subject;
  dd_remedy remedy;
  int64_t index;       /* of the subject; -1 where that is DD_SUBJECT_NONE */
  const char* message; /* English, UTF-8, valid until the thread's next call. A sentence, or where
                          there is a subject the rest of one that begins with its name */
} dd_error;

/* Describes the last call of this thread that did not return DD_OK. */
DD_API dd_status dd_last_error(dd_error* error);

/* The same as one text in English: subject, message and remedy. Valid until the next call. */
DD_API const char* dd_last_message(void);

/* ---- The library ---- */

/* The ABI of the library that was loaded; compare with DD_ABI_VERSION before anything else. */
DD_API int32_t dd_abi_version(void);

/* The library's version, "major.minor.patch". Static text. */
DD_API const char* dd_version(void);

/* The instruction set the per-frame kernels use on this machine: "avx2" or "baseline". */
DD_API const char* dd_instruction_set(void);

/* ---- What all share ---- */

/* Points to read: x, y and z of each as three consecutive floats. */
typedef struct dd_points {
  const float* first;
  size_t count;
  size_t stride; /* bytes from one point to the next: a multiple of 4 from 12 to 4096 */
} dd_points;

/* Points to write. */
typedef struct dd_points_out {
  float* first;
  size_t count;
  size_t stride;
} dd_points_out;

/* A triangle mesh. */
typedef struct dd_mesh {
  dd_points vertices;
  const int32_t* triangles;
  size_t triangle_count;
} dd_mesh;

/* The role of a vertex: the number of the handle that moves it, or one of these. */
DD_ENUM(dd_role){DD_ROLE_FREE = -1, DD_ROLE_FIXED = -2};

/* What is carried from triangle to triangle. */
DD_ENUM(dd_gradients){
    DD_GRADIENTS_ROTATIONS = 0, /* the rotations of the deformation gradients: details keep their
                                   size */
    DD_GRADIENTS_WHOLE = 1,     /* the deformation gradients: details are stretched along */
};

/* What a result is written as. */
DD_ENUM(dd_values){
    DD_VALUES_POSITIONS = 0,
    DD_VALUES_OFFSETS = 1, /* the deformed minus the rest position */
};

/* The linear system by which a surface is reconstructed from deformation gradients. */
DD_ENUM(dd_formulation){
    DD_FORMULATION_SURFACE = 0,       /* a row a vertex: the fastest */
    DD_FORMULATION_FOURTH_POINTS = 1, /* Sumner and Popovic's, weighted by volumes: a row a vertex
                                         and a triangle; needs triangles with area */
    DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED = 2, /* the same as they published it */
};

/* What a frame computes with. The factor is computed in double precision in any case. */
DD_ENUM(dd_precision){
    DD_PRECISION_SINGLE = 0, /* halves what a frame reads; results within 1e-5 of the box of those
                                in double. Where the mesh doesn't allow it, iterative refinement or
                                double precision is used. From 200,000 free vertices on, rims are
                                smoothed by a coarse surface, which saves a quarter of the memory:
                                at 99% of the vertices, results are within 2e-4 */
    DD_PRECISION_DOUBLE = 1,
};

/* ---- Jobs ----
 *
 * Long work is a job: a bind, an update, a transfer's factorization, or a match. A call starts it
 * and returns at once. That call refuses wrong arguments; whatever else is wrong is reported where
 * the job ends. */

typedef struct dd_job dd_job;
typedef struct dd_deformer dd_deformer; /* a bound surface */
typedef struct dd_draft dd_draft;       /* a preview of one, see dd_job_take_draft */
typedef struct dd_transfer dd_transfer; /* a source and a target, factored */
typedef struct dd_match dd_match;       /* correspondences that were found */

DD_ENUM(dd_job_state){DD_JOB_RUNNING = 0, DD_JOB_DONE = 1, DD_JOB_FAILED = 2};

/* What a job is doing. */
DD_ENUM(dd_stage){
    DD_STAGE_STARTING = 0,
    DD_STAGE_OPERATORS = 1,       /* of a bind: operators of the mesh */
    DD_STAGE_POISSON = 2,         /* factoring the Poisson system */
    DD_STAGE_ENERGY = 3,          /* factoring the base surface's energy */
    DD_STAGE_BASE = 4,            /* computing the base surface */
    DD_STAGE_HANDLES = 5,         /* computing the handles' basis functions */
    DD_STAGE_ENERGY_ON_BASE = 6,  /* factoring the energy on the base */
    DD_STAGE_DEFORMING = 7,       /* of an update */
    DD_STAGE_VOLUMES = 8,         /* preparing DD_METHOD_VOLUMES */
    DD_STAGE_RESTORING = 9,       /* restoring the volumes */
    DD_STAGE_MESHES = 10,         /* of a match or a transfer: reading the meshes */
    DD_STAGE_FUNCTIONS = 11,      /* of a match: their smoothest functions */
    DD_STAGE_PLACEMENTS = 12,     /* comparing placements */
    DD_STAGE_MAP = 13,            /* refining the map between the functions */
    DD_STAGE_SIDES = 14,          /* comparing left and right */
    DD_STAGE_PLACING = 15,        /* placing the source on the target */
    DD_STAGE_FITTING = 16,        /* deforming the source onto the target */
    DD_STAGE_CORRESPONDENCE = 17, /* looking for corresponding triangles */
    DD_STAGE_DONE = 18,
};

typedef struct dd_progress {
  uint32_t struct_size;
  dd_job_state state;
  dd_stage stage;
  double fraction; /* 0 .. 1; it never falls */
} dd_progress;

/* Tells how far a job is; doesn't wait. */
DD_API dd_status dd_job_poll(const dd_job* job, dd_progress* progress);

/* Asks a job to stop; doesn't wait. The job stops at its next stage, or soon in a factorization or
 * in a search, and ends with DD_ERROR_CANCELLED unless it was complete already. */
DD_API dd_status dd_job_cancel(dd_job* job);

/* Waits for a job to end, and returns the status of its work; dd_last_error() is then about that.
 * It may be called any number of times. */
DD_API dd_status dd_job_finish(dd_job* job);

/* These wait as dd_job_finish does, and return its status where that is not DD_OK. Then what the
 * job made becomes the caller's; a second call returns DD_ERROR_ARGUMENT, and so does one of
 * another kind than the job's. The job itself is still to be released. */
DD_API dd_status dd_job_take_deformer(dd_job* job, dd_deformer** deformer);
DD_API dd_status dd_job_take_transfer(dd_job* job, dd_transfer** transfer);
DD_API dd_status dd_job_take_match(dd_job* job, dd_match** match);

/* All vertices that a failed job's error is about, where dd_error names one; else none. Waits as
 * dd_job_finish does.
 *   out            room for capacity vertices; null with a capacity of 0
 *   vertex_count   how many there are */
DD_API dd_status dd_job_get_vertices(dd_job* job, int32_t* out, size_t capacity,
                                     size_t* vertex_count);

/* Releases a job; one that still runs is cancelled and waited for. */
DD_API void dd_job_free(dd_job* job);

/* ---- Binding ---- */

/* The geometry on which the energy that deforms the base surface is built. */
DD_ENUM(dd_base_metric){
    DD_METRIC_SURFACE = 0, /* the surface: rigid and affine motions are exact, one factorization */
    DD_METRIC_BASE = 1,    /* the base surface, as in the paper's text */
};

/* The order of that energy: what the base keeps small, and how it meets its border. */
DD_ENUM(dd_smoothness){
    DD_SMOOTHNESS_MEMBRANE = 1,            /* area; meets its border with a crease */
    DD_SMOOTHNESS_THIN_PLATE = 2,          /* curvature; the paper's */
    DD_SMOOTHNESS_CURVATURE_VARIATION = 3, /* change of curvature */
};

/* The triangles by which a surface is measured and carries gradients. Its shape is that of the mesh
 * in any case. */
DD_ENUM(dd_triangulation){
    DD_TRIANGULATION_DELAUNAY = 0, /* intrinsic Delaunay: how faces were cut into triangles hardly
                                      matters */
    DD_TRIANGULATION_GIVEN = 1,    /* the mesh's own, as in the paper's text */
};

typedef struct dd_bind_options {
  uint32_t struct_size;
  dd_base_metric base_metric;
  double metric_smoothing;        /* >= 0, in mean edge lengths: the surface is faired so far before
                                     the energy is built on it; with DD_METRIC_SURFACE only;
                                     sensible up to 4. By default 0 */
  dd_smoothness smoothness;       /* by default DD_SMOOTHNESS_THIN_PLATE */
  dd_triangulation triangulation; /* by default DD_TRIANGULATION_DELAUNAY */
  dd_precision precision;         /* by default DD_PRECISION_SINGLE */
  int32_t threads; /* the most that the bind and each update may use, the caller's among them:
                      1 .. 1024. By default as many as the machine has, at most 8. Results
                      don't depend on it */
  int32_t draft;   /* 1: dd_job_take_draft has something to give. By default 0 */
  /* A base surface from outside, at rest: then handle_count may be 0, free parts that nothing holds
   * are carried by their base, and base_metric, metric_smoothing and smoothness don't matter. Null,
   * the default: the base is computed. */
  const dd_points* base;
  /* Null: the base has the mesh's own vertices and triangles. Else it is a mesh of its own, a cage
   * or a coarser or finer copy: each vertex of the mesh follows the nearest point of it, with a
   * rotation that is continuous across its edges. */
  const int32_t* base_triangles;
  size_t base_triangle_count;
  /* Poses of the mesh, for DD_METHOD_EXAMPLES; they cost nothing before that method is used. An
   * example's rotation matters, its translation doesn't. */
  const dd_points* examples;
  size_t example_count; /* at most 1000 */
  /* A number for each vertex: 0 is soft, 1 is rigid, by updates with refinement or by
   * DD_METHOD_GRADIENT: a part that is small beside the deforming area is off a rigid motion by
   * less than 1e-3 of its size. Parts of .5 resist 100 times as much as those of 0. Only
   * differences matter: to make a joint softer than the rest, give the rest more. Null, the
   * default: all of the surface is equally soft. */
  const float* stiffness;
  size_t stiffness_count;
} dd_bind_options;

/* Fills in the defaults. size: sizeof(dd_bind_options), here and in all of these functions of their
 * structs. */
DD_API dd_status dd_bind_options_init(dd_bind_options* options, size_t size);

/* Starts to bind: a job that makes a dd_deformer.
 *   mesh           the surface at rest
 *   roles          role_count values, one a vertex: a dd_role, or a handle below handle_count
 *   handle_count   >= 1 unless a base is given; each handle has at least one vertex */
DD_API dd_status dd_deformer_bind_start(const dd_mesh* mesh, const int32_t* roles,
                                        size_t role_count, int32_t handle_count,
                                        const dd_bind_options* options, dd_job** job);

/* ---- Updating ---- */

/* How the surface follows its handles. */
DD_ENUM(dd_method){
    DD_METHOD_DETAIL = 0,      /* the paper's: a smooth base bends, details turn with it */
    DD_METHOD_VARIATIONAL = 1, /* the smoothest displacement: details are moved, not turned */
    DD_METHOD_NORMAL = 2,      /* a smooth base bends, details stand on it along its normals */
    DD_METHOD_GRADIENT = 3,    /* the handles' rotations and scales spread over the surface; their
                                  translations turn nothing */
    DD_METHOD_VOLUMES = 4,     /* details keep their volume over the base. Slow: use it by
                                  dd_deformer_update_start */
    DD_METHOD_EXAMPLES = 5,    /* posing by example: the blend of the bind's examples that fits the
                                  handles best. Without examples: the gradients of the rest pose */
};

/* The surface that an update returns. */
DD_ENUM(dd_output){
    DD_OUTPUT_RESULT = 0, /* the deformed surface */
    DD_OUTPUT_BASE = 1,   /* the deformed base surface; solid limbs, of which it is a thread, with
                             their thickness and without relief */
};

/* How the handles move a computed base. */
DD_ENUM(dd_base_deformer){
    DD_BASE_DEFORMER_AUTOMATIC = 0, /* linear where no handle turns by more than 135 degrees against
                                       another one or a fixed part, motions from 180 on, a blend in
                                       between */
    DD_BASE_DEFORMER_LINEAR = 1,    /* the smoothest displacement, as in the paper. Stretches least,
                                       but collapses towards half a turn */
    DD_BASE_DEFORMER_MOTIONS = 2,   /* blends the handles' rotations by harmonic weights: even
                                       twists and arcs, of any number of turns */
};

/* What determines a handle's rotation. */
DD_ENUM(dd_handle_turns){
    DD_HANDLE_TURNS_TARGET = 0, /* its matrix */
    DD_HANDLE_TURNS_FREE = 1,   /* the surface: the matrix only places the handle's pivot, and the
                                   rotation is the one that strains the base least, so that a limb
                                   pulled by its hand needs no twist of the wrist */
};

/* Rotations found iteratively, by DD_METHOD_DETAIL with rotations on the surface's formulation, and
 * by DD_METHOD_EXAMPLES. Costs about one linear update for each iteration on small meshes, far less
 * on large ones. */
typedef struct dd_refinement_options {
  uint32_t struct_size;
  int32_t iterations;        /* 0 .. 10000; 0 is the paper's linear result. By default 4 */
  double rotation_smoothing; /* the length over which an iteration smooths the rotations, as a
                                fraction of the square root of the deforming area, 0 .. 1. Shorter
                                bends more sharply and may fold; longer is stiffer. By default
                                0.009 */
  double
      rim_smoothing; /* the distance from handles and fixed parts within which the surface's slope
                           is matched as well as its place, as a fraction of the square root of the
                           deforming area, 0 .. 1; 0 leaves a crease there. By default 0.05 */
  double solidity;   /* 0 .. 1: 0 bends the surface as a hollow skin, 1 as a solid body whose limbs
                      keep their cross-sections when they are bent, led aside or twisted. Acts where
                      the surface encloses something thinner than about half of the way along it
                      from a handle to a fixed part or another handle. A motion in steps is that of
                      a hollow skin. By default 1 */
} dd_refinement_options;

DD_API dd_status dd_refinement_options_init(dd_refinement_options* options, size_t size);

/* Of DD_METHOD_NORMAL. */
typedef struct dd_normal_options {
  uint32_t struct_size;
  int32_t levels; /* 1 .. 20 surfaces from the mesh to the base, each displaced from the next
                     smoother one. By default 1 */
} dd_normal_options;

DD_API dd_status dd_normal_options_init(dd_normal_options* options, size_t size);

/* Of DD_METHOD_VOLUMES. */
typedef struct dd_volumes_options {
  uint32_t struct_size;
  int32_t iterations; /* 0 or more: it stops after so many anyway. By default 50 */
  double tolerance;   /* >= 0, in mean heights of the details: it stops when no vertex moves by more
                         in an iteration. By default 0.01 */
} dd_volumes_options;

DD_API dd_status dd_volumes_options_init(dd_volumes_options* options, size_t size);

/* Of DD_METHOD_EXAMPLES. */
typedef struct dd_examples_options {
  uint32_t struct_size;
  /* The pose of these weights, one for each example, is shown and the handles are let go; 0 is the
   * rest pose, 1 the example. Null, the default: the weights that fit the handles are found. */
  const double* weights;
  size_t weight_count;
  double stiffness; /* >= 0: a factor on what keeps found weights near a guess from the handles'
                       places and within 0 .. 1. By default 1 */
  /* The least and the largest weight that may be found for each example, two numbers each: 0 or
   * less and 0 or more, possibly infinite. Null, the default: any. */
  const double* limits;
  size_t limit_count;
} dd_examples_options;

DD_API dd_status dd_examples_options_init(dd_examples_options* options, size_t size);

typedef struct dd_update_options {
  uint32_t struct_size;
  dd_method method;               /* by default DD_METHOD_DETAIL */
  dd_gradients gradients;         /* by default DD_GRADIENTS_ROTATIONS. Of no meaning to
                                     DD_METHOD_VARIATIONAL */
  dd_formulation formulation;     /* of DD_METHOD_DETAIL; only DD_FORMULATION_SURFACE, the default,
                                     is refined */
  dd_base_deformer base_deformer; /* by default DD_BASE_DEFORMER_AUTOMATIC */
  dd_output output;               /* by default DD_OUTPUT_RESULT */
  dd_values values;               /* by default DD_VALUES_POSITIONS */
  int32_t steps; /* 1 .. 1000: a large motion is cut into so many, and after each the surface is
                    bound anew to its result. More than one is slow (use dd_deformer_update_start),
                    and not possible with a base from outside. By default 1 */
  const dd_points* base; /* the deformed base, where the bind was given one; else null */
  /* For each handle its dd_handle_turns. Null, the default: DD_HANDLE_TURNS_TARGET. */
  const int32_t* handle_turns;
  size_t handle_turn_count;
  /* For each handle how far it has turned, a rotation vector (axis times radians), so that this may
   * be more than half a turn. It need not be exact: the nearest rotation vector of the handle's
   * matrix is used. Null, the default: the shortest way. */
  const double* turns;
  size_t turn_count;
  /* Of free handles, three numbers for each handle: the point at rest that its matrix places, not
   * beyond 1e4 of the mesh's size. Null, the default: the mean of its vertices. */
  const double* pivots;
  size_t pivot_count;
  /* Null, the default, stands for each one's defaults. */
  const dd_refinement_options* refinement;
  const dd_normal_options* normal;
  const dd_volumes_options* volumes;
  const dd_examples_options* examples;
} dd_update_options;

DD_API dd_status dd_update_options_init(dd_update_options* options, size_t size);

/* Makes one frame. The first update by a method prepares it, which may take as long as a hundred of
 * its updates.
 *   matrices   for each of matrix_count handles a row-major 3x4 affine matrix that takes the rest
 *              place of its vertices to the present one; null where there is no handle
 *   out        as many points as the mesh has vertices
 * Matrices that are not finite are refused, and so is a result that is not finite or leaves the
 * range of floats. */
DD_API dd_status dd_deformer_update(dd_deformer* deformer, const double* matrices,
                                    size_t matrix_count, const dd_update_options* options,
                                    const dd_points_out* out);

/* Starts an update as a job, for what is slow: steps, and DD_METHOD_VOLUMES. The job keeps the
 * deformer alive, which may be freed meanwhile. It has the deformer in use during the first step;
 * the later ones work on surfaces of their own. */
DD_API dd_status dd_deformer_update_start(dd_deformer* deformer, const double* matrices,
                                          size_t matrix_count, const dd_update_options* options,
                                          dd_job** job);

/* Facts about an update that was a job. */
typedef struct dd_update_info {
  uint32_t struct_size;
  int32_t volumes_converged; /* 0: DD_METHOD_VOLUMES stopped at its limit of iterations */
  double volume_error;       /* of DD_METHOD_VOLUMES: the sum of the volumes' absolute changes over
                                the sum of the volumes */
} dd_update_info;

/* What such a job found; they wait as dd_job_finish does, and may be called any number of times. */
DD_API dd_status dd_job_get_update(dd_job* job, const dd_points_out* out);
DD_API dd_status dd_job_get_update_info(dd_job* job, dd_update_info* info);

/* Takes the draft of a bind: a preview that some ten thousand of the vertices make by themselves
 * and that carries the others, there in a fraction of the time. Handles are met exactly, rest is
 * rest; between them it differs from the result by about what another density of the mesh would
 * change. Null where it is not there yet, was taken before or isn't made: without
 * dd_bind_options.draft, with a base from outside, and where the mesh has too few vertices. Does
 * not wait, and may be called while another thread uses the job. */
DD_API dd_status dd_job_take_draft(dd_job* job, dd_draft** draft);

/* One frame of it, as of dd_deformer_update(), by any method but DD_METHOD_EXAMPLES. Steps are
 * taken as one. */
DD_API dd_status dd_draft_update(dd_draft* draft, const double* matrices, size_t matrix_count,
                                 const dd_update_options* options, const dd_points_out* out);

DD_API void dd_draft_free(dd_draft* draft);

/* Facts about a bound surface. Each example is one of those that are counted, -1 where there is
 * none. */
typedef struct dd_deformer_info {
  uint32_t struct_size;
  int32_t vertex_count;
  int32_t triangle_count;
  int32_t handle_count;
  int32_t free_count;    /* vertices that are solved for */
  int32_t resting_count; /* vertices in the region that no handle reaches: they stay at rest */
  int32_t resting_component_count; /* loose parts with faces that these belong to */
  int32_t resting_example;
  int32_t loose_count; /* free vertices without a face: they stay at rest */
  int32_t loose_example;
  int32_t degenerate_count; /* triangles without a usable area, given a tiny one, near the region */
  int32_t degenerate_example;
  int32_t idle_handle_count; /* handles without a free vertex beside them: nothing follows them */
  int32_t idle_handle_example;
  int32_t stand_in_count;      /* triangles whose base has no area: they turn with a neighbour or
                                  with their handle; 0 before the first DD_METHOD_DETAIL */
  int32_t unrepresented_count; /* vertices where the surface is no height field over the next
                                  smoother one, summed over levels: DD_METHOD_NORMAL fails there; 0
                                  before its first update */
  int32_t unrepresented_example;
  int32_t far_count; /* vertices farther from a base of its own topology than a tenth of its size:
                        what they follow is a guess */
  int32_t far_example;
  int32_t torn_count; /* vertices whose nearest point of such a base lies far from a neighbour's:
                         they may follow different parts of it */
  int32_t torn_example;
  int32_t proxy_vertex_count;  /* of such a base; 0 where there is none */
  int32_t coarse_vertex_count; /* of the coarse surface on which refinement finds its rotations; 0
                                  where there is none, or no refined update yet */
  double bind_seconds;         /* what the bind took */
  double bytes;                /* memory that the deformer holds */
} dd_deformer_info;

DD_API dd_status dd_deformer_get_info(const dd_deformer* deformer, dd_deformer_info* info);

/* What dd_deformer_info counts. */
DD_ENUM(dd_finding){
    DD_FINDING_RESTING = 0,       DD_FINDING_LOOSE = 1,
    DD_FINDING_DEGENERATE = 2, /* the corners of these triangles */
    DD_FINDING_UNREPRESENTED = 3, DD_FINDING_FAR = 4,
    DD_FINDING_TORN = 5,
};

/* All vertices of a finding, each once.
 *   out            room for capacity vertices; null with a capacity of 0
 *   vertex_count   how many there are */
DD_API dd_status dd_deformer_get_vertices(const dd_deformer* deformer, dd_finding finding,
                                          int32_t* out, size_t capacity, size_t* vertex_count);

/* The weights of the last update by DD_METHOD_EXAMPLES, found or given; zeros before it.
 *   out   a number for each of out_count examples */
DD_API dd_status dd_deformer_get_example_weights(const dd_deformer* deformer, double* out,
                                                 size_t out_count);

DD_API void dd_deformer_free(dd_deformer* deformer);

/* ---- Deformation transfer between meshes ----
 *
 *   dd_transfer_start(&source, &target, pairs, pair_count, NULL, &job);
 *   dd_job_take_transfer(job, &transfer);
 *   dd_job_free(job);
 *   dd_transfer_apply(transfer, &pose, NULL, &out);
 *   ...the same for each further pose...
 *   dd_transfer_free(transfer);
 *
 * Meshes whose correspondences aren't known are matched first: see dd_match_start. */

/* What pairs are of. */
DD_ENUM(dd_pairs_of){
    DD_PAIRS_OF_TRIANGLES = 0,
    DD_PAIRS_OF_VERTICES =
        1,                   /* a triangle's sources are those with the most corners paired with its
                                 own */
    DD_PAIRS_OF_NEAREST = 2, /* none are given: the target is worn by the source, as a garment by a
                                 body, and follows the nearest points of it at rest */
};

/* What decides where a transferred pose is: gradients leave the place of each loose part open. */
DD_ENUM(dd_anchor){
    DD_ANCHOR_SOURCE = 0,   /* every part moves along with its source */
    DD_ANCHOR_CENTROID = 1, /* the centre of the surface stays */
    DD_ANCHOR_VERTICES = 2, /* the mean of the anchors stays, or goes to the mean of given places */
    DD_ANCHOR_PINNED = 3,   /* each anchor stays, or goes to its given place */
};

/* How places are corrected in parts of the target that nothing pins. */
DD_ENUM(dd_placing){
    DD_PLACING_VERTICES = 0, /* each vertex towards the place of its source, as far as the shapes
                                  are alike; with DD_PAIRS_OF_NEAREST as close as it lies, kept
                                  outside of the source. Needs DD_GRADIENTS_WHOLE */
    DD_PLACING_COMPONENTS =
        1,                /* each loose part as a whole; within it the gradients alone decide */
    DD_PLACING_PARTS = 2, /* each loose part as a rigid body, as buttons, armour and glasses */
    DD_PLACING_DISPLACEMENTS = 3, /* each vertex by its source's displacement, for shape keys in a
                                     family of shapes; scaled by the meshes' sizes where these
                                     differ by more than a fifth. Needs DD_GRADIENTS_WHOLE */
};

typedef struct dd_transfer_options {
  uint32_t struct_size;
  dd_pairs_of pairs_of;       /* by default DD_PAIRS_OF_TRIANGLES */
  dd_formulation formulation; /* by default DD_FORMULATION_SURFACE */
  dd_anchor anchor;           /* by default DD_ANCHOR_SOURCE */
  dd_placing placing;         /* by default DD_PLACING_VERTICES */
  dd_precision precision;     /* of the system. By default DD_PRECISION_DOUBLE */
  int32_t threads;            /* as of dd_bind_options */
  double gap; /* with DD_PAIRS_OF_NEAREST and DD_PLACING_VERTICES: how far outside of the source the
                 target is kept, as a fraction of its box, or three quarters of its distance at rest
                 where that is less; inside where most of it is inside at rest. Negative: it may go
                 through. By default 0.005 */
  /* Vertices of the target, for DD_ANCHOR_VERTICES and DD_ANCHOR_PINNED. */
  const int32_t* anchors;
  size_t anchor_count;
  /* The rotation or reflection, scale and shift that takes the source onto the target, a row-major
   * 3x4 matrix; deformations are turned with it. Null, the default: as the pairs say, exact where
   * the target is a moved and scaled copy or its mirror image. */
  const double* placement;
  /* For each vertex of the target the triangle of the source in which its point is, or -1, and the
   * point's three barycentric weights, as dd_match_get_points() gives them: more exact than pairs.
   * Null, the default: as the pairs say. Not with DD_PAIRS_OF_NEAREST. */
  const int32_t* point_triangles;
  size_t point_triangle_count;
  const float* point_weights;
  size_t point_weight_count; /* vertices of the target */
} dd_transfer_options;

DD_API dd_status dd_transfer_options_init(dd_transfer_options* options, size_t size);

/* Starts to factor the target's system: a job that makes a dd_transfer.
 *   pairs   pair_count pairs of numbers, source and target; a target's triangle may have none, one
 *           or many sources, which are averaged. Null: the meshes are of the same topology, each
 *           triangle its own source, or with DD_PAIRS_OF_NEAREST they are found */
DD_API dd_status dd_transfer_start(const dd_mesh* source, const dd_mesh* target,
                                   const int32_t* pairs, size_t pair_count,
                                   const dd_transfer_options* options, dd_job** job);

typedef struct dd_apply_options {
  uint32_t struct_size;
  dd_gradients gradients;  /* by default DD_GRADIENTS_WHOLE */
  dd_values values;        /* by default DD_VALUES_POSITIONS */
  const dd_points* places; /* where the anchors go. Null, the default: they stay */
} dd_apply_options;

DD_API dd_status dd_apply_options_init(dd_apply_options* options, size_t size);

/* Transfers one pose, by one back-substitution.
 *   pose   the source's vertices, deformed
 *   out    as many points as the target has vertices */
DD_API dd_status dd_transfer_apply(dd_transfer* transfer, const dd_points* pose,
                                   const dd_apply_options* options, const dd_points_out* out);

/* Facts about a transfer. Each example is one of those that are counted, -1 where there is none. */
typedef struct dd_transfer_info {
  uint32_t struct_size;
  int32_t unmatched_count; /* triangles of the target without a source: they take the gradient of
                              the nearest one over the surface that has one */
  int32_t unmatched_example;
  int32_t unmatched_component_count; /* loose parts of the target none of whose triangles has one */
  int32_t unmatched_component_example; /* a vertex of one */
  int32_t loose_count;                 /* vertices of the target without a triangle: they stay */
  int32_t degenerate_count;            /* triangles of the target with next to no area */
  int32_t degenerate_example;
  int32_t overstretched_count; /* triangles of the source that correspond to more than eight times
                                  their area: the mean of those around them stands in for them */
  int32_t overstretched_example;
  int32_t through_count; /* vertices of a worn target that are through the source at rest: they are
                            kept from going farther */
  int32_t through_example;
  int32_t mirrored; /* 1: the target corresponds to the source's mirror image, and is deformed as
                       that would be */
  int32_t unknowns; /* rows of the system */
  double nonzeros;  /* of the system */
  double worn_distance; /* with DD_PAIRS_OF_NEAREST: the mean distance of the target's vertices from
                           the source, in the target's unit */
  double placement[12]; /* a row-major 3x4 matrix: of the source onto the target */
} dd_transfer_info;

DD_API dd_status dd_transfer_get_info(const dd_transfer* transfer, dd_transfer_info* info);

DD_API void dd_transfer_free(dd_transfer* transfer);

/* ---- Matching ---- */

typedef struct dd_match_options {
  uint32_t struct_size;
  int32_t stages;       /* 1 .. 1000, of growing pull to the target. By default 8 */
  int32_t rounds;       /* 1 .. 1000, of searching closest points in each stage. By default 3 */
  int32_t threads;      /* as of dd_bind_options */
  double smoothness;    /* >= 0, the weight of alike gradients of neighbours. By default 1 */
  const double* stance; /* how the source stands to the target, beside how their positions have it,
                           as in a scene: a row-major 3x4 matrix of a rotation, scale and shift. An
                           open part that lies on the other mesh so corresponds to what it lies on.
                           Null, the default: nothing is known */
} dd_match_options;

DD_API dd_status dd_match_options_init(dd_match_options* options, size_t size);

/* Starts to place the source on the target, to deform it onto it and to look for corresponding
 * triangles: a job that makes a dd_match.
 *   markers   marker_count pairs of vertices, source and target, that must fall on one another: any
 *             number. The source is placed by shape, so that poses, remeshes and akin shapes need
 *             none, and by three markers that are not on a line; what then fits better is taken.
 *             Turns that fit about as well are settled by how the meshes stand, or by a marker or
 *             two. It is mirrored only where four or more that are not in a plane say so. */
DD_API dd_status dd_match_start(const dd_mesh* source, const dd_mesh* target,
                                const int32_t* markers, size_t marker_count,
                                const dd_match_options* options, dd_job** job);

typedef struct dd_match_info {
  uint32_t struct_size;
  int32_t ambiguous; /* 1: turned otherwise, the source fits about as well; markers settle it */
  int32_t mirrored;  /* 1: the markers say that the target is the source's mirror image */
  double confidence; /* of all triangles of the target, the mean by area, 0 .. 1 */
} dd_match_info;

DD_API dd_status dd_match_get_info(const dd_match* match, dd_match_info* info);

/* The source deformed onto the target: as many points as the source has vertices. */
DD_API dd_status dd_match_get_positions(const dd_match* match, const dd_points_out* out);

/* Pairs of triangles, source and target, as dd_transfer_start takes them.
 *   out          room for capacity pairs; null with a capacity of 0
 *   pair_count   how many there are */
DD_API dd_status dd_match_get_pairs(const dd_match* match, int32_t* out, size_t capacity,
                                    size_t* pair_count);

/* For each of the vertex_count vertices of the target the point of the source that it corresponds
 * to, as dd_transfer_options takes them.
 *   triangles   of the source; -1 where nothing corresponds
 *   weights     three numbers for each vertex: of the triangle's corners */
DD_API dd_status dd_match_get_points(const dd_match* match, int32_t* triangles, float* weights,
                                     size_t vertex_count);

/* How well each of the out_count triangles of the target is matched, 0 .. 1: less where the source
 * lies off it or at an angle, and where it was stretched to come there (a half at three times). */
DD_API dd_status dd_match_get_confidence(const dd_match* match, float* out, size_t out_count);

DD_API void dd_match_free(dd_match* match);

/* ---- Loose parts that ride along ---- */

typedef struct dd_riders dd_riders; /* parts, and on what they ride */

typedef struct dd_riders_options {
  uint32_t struct_size;
  int32_t threads;       /* as of dd_bind_options */
  const int32_t* riders; /* rider_count pairs: a vertex, each once, and its group */
  size_t rider_count;
  const int32_t* contacts; /* contact_count pairs: a group and a triangle, at least one for each
                              group. No corner of a triangle may be among the riders: what rides on
                              those is placed after them, by a dd_riders of its own */
  size_t contact_count;
  const double*
      sizes; /* of group_count groups, in the unit of the positions. 0: by the mean, always */
  size_t group_count;
} dd_riders_options;

DD_API dd_status dd_riders_options_init(dd_riders_options* options, size_t size);

/* Plates, rivets, eyes, hair cards and other loose parts that lie on a surface or stick in it, in
 * groups of vertices. A group moves rigidly: by the mean motion of the triangles on which it rides,
 * weighted by area, or, where these move apart by more than a fiftieth of its size, by their
 * median.
 *   mesh   at rest */
DD_API dd_status dd_riders_make(const dd_mesh* mesh, const dd_riders_options* options,
                                dd_riders** made);

/* Places the riders by the offsets of the surface, those of DD_VALUES_OFFSETS.
 *   offsets   as many as the mesh has vertices
 *   out       as many; those of the riders are written, all others left. It may be the same
 *             memory */
DD_API dd_status dd_riders_place(dd_riders* riders, const dd_points* offsets,
                                 const dd_points_out* out);

DD_API void dd_riders_free(dd_riders* riders);

/* ---- Measures and distances ---- */

typedef struct dd_measure_options {
  uint32_t struct_size;
  const dd_points* base; /* the base at rest and deformed: both, or neither, the default */
  const dd_points* deformed_base;
} dd_measure_options;

DD_API dd_status dd_measure_options_init(dd_measure_options* options, size_t size);

/* How a deformed surface compares with the one at rest, over triangles with a free corner. */
typedef struct dd_measures {
  uint32_t struct_size;
  int32_t intersecting_pairs;     /* pairs of triangles that pass through each other */
  int32_t new_intersecting_pairs; /* of those, the ones that don't at rest */
  int32_t intersecting_triangles; /* triangles in such a pair */
  double stretch;      /* area-weighted mean Frobenius distance of the deformation gradients from
                          their rotations */
  double normal_error; /* mean angle in degrees between the triangles' normals and those at rest
                          turned by the base's rotation; 0 without a base */
  double area_ratio;
  double volume_ratio; /* of signed volumes: of use for closed surfaces */
} dd_measures;

/* Measures a deformation. It takes seconds for 100,000 triangles.
 *   mesh       the surface at rest
 *   roles      as for dd_deformer_bind_start
 *   deformed   its vertices, deformed */
DD_API dd_status dd_mesh_measure(const dd_mesh* mesh, const int32_t* roles, size_t role_count,
                                 const dd_points* deformed, const dd_measure_options* options,
                                 dd_measures* measures);

/* The geodesic distance of every vertex from the nearest source: a few percent too long at most on
 * good meshes; infinite where no path of triangles leads.
 *   sources   source_count values, one a vertex, not 0 for a source
 *   out       a number for each of out_count vertices, in the unit of the positions */
DD_API dd_status dd_mesh_distances(const dd_mesh* mesh, const int32_t* sources, size_t source_count,
                                   float* out, size_t out_count);

/* The deformation gradients at the vertices: of each vertex the mean over the triangles around it,
 * weighted by their areas at rest; the identity where no triangle has an area.
 *   mesh       the surface at rest
 *   deformed   its vertices, deformed
 *   out        9 numbers, a row-major 3x3 matrix, for each of out_count vertices */
DD_API dd_status dd_mesh_vertex_gradients(const dd_mesh* mesh, const dd_points* deformed,
                                          float* out, size_t out_count);

#ifdef __cplusplus
}
#endif

#endif
