
/* STEP_DAMPING: damping of the steps to a foot's place, m^2. */
#define STEP_DAMPING 1e-9
/* POSE_TOLERANCE: distance from its target, m and rad, and rate at which a pose has reached it. */
#define POSE_TOLERANCE 1e-5

static void cross(const cpg_real *a, const cpg_real *b, cpg_real *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Turn a vector about an axis, a unit vector. */
static void turn_about(const cpg_real *axis, cpg_real angle, cpg_real *v)
{
    const cpg_real c = cos(angle), s = sin(angle);
    const cpg_real along = (1.0 - c) * (axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]);
    cpg_real side[3];
    cross(axis, v, side);
    for (int16_t i = 0; i < 3; i++) {
        v[i] = c * v[i] + s * side[i] + along * axis[i];
    }
}

/* Fill where a leg's foot is, m, and its derivatives by the joints, m/rad. */
static void foot_at(const cpg_body *b, int16_t leg, const cpg_real *angles, cpg_real *foot,
                    cpg_real slope[3][3])
{
    const int16_t *joint = b->joints[leg];
    const cpg_real (*limb)[3] = b->limbs[leg];  /* axes, links, hip, foot */
    memset(foot, 0, 3 * sizeof *foot);
    memset(slope, 0, 9 * sizeof **slope);
    for (int16_t k = 2; k >= 0; k--) {
        if (joint[k] < 0) {
            continue;
        }
        for (int16_t i = 0; i < 3; i++) {
            foot[i] += limb[3 + k][i];
        }
        turn_about(limb[k], angles[joint[k]], foot);
        for (int16_t n = k + 1; n < 3; n++) {
            turn_about(limb[k], angles[joint[k]], slope[n]);
        }
        cross(limb[k], foot, slope[k]);
    }
    for (int16_t i = 0; i < 3; i++) {
        foot[i] += limb[6][i];
    }
}

/* Fill where the feet are, m, in the frame of the base. */
void cpg_feet(const cpg_body *b, const cpg_real *angles, cpg_real (*feet)[3])
{
    cpg_real slope[3][3];
    for (int16_t leg = 0; leg < b->legs; leg++) {
        foot_at(b, leg, angles, feet[leg], slope);
    }
}

/* Take a step of damped least squares towards a leg with its foot at a place, m; return how far
 * the foot has been from there, m. */
static cpg_real step_to(const cpg_body *b, int16_t leg, const cpg_real *place, cpg_real *angles)
{
    const int16_t *joint = b->joints[leg];
    cpg_real foot[3], slope[3][3], gap[3], square[3][3], way[3] = {0.0};
    foot_at(b, leg, angles, foot, slope);
    for (int16_t i = 0; i < 3; i++) {
        gap[i] = place[i] - foot[i];
        for (int16_t k = 0; k < 3; k++) {
            square[i][k] = i == k ? STEP_DAMPING : 0.0;
            for (int16_t n = 0; n < 3; n++) {
                square[i][k] += slope[n][i] * slope[n][k];
            }
        }
    }
    cpg_real across[3], whole = 0.0;
    for (int16_t i = 0; i < 3; i++) {
        cross(square[(i + 1) % 3], square[(i + 2) % 3], across);
        whole = i ? whole : square[0][0] * across[0] + square[0][1] * across[1]
                          + square[0][2] * across[2];
        for (int16_t k = 0; k < 3; k++) {
            way[k] += gap[i] * across[k] / whole;
        }
    }
    for (int16_t k = 0; k < 3; k++) {
        if (joint[k] >= 0) {
            angles[joint[k]] += slope[k][0] * way[0] + slope[k][1] * way[1] + slope[k][2] * way[2];
        }
    }
    return sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]);
}

/* Change angles, rad, until the feet are where they stand, seen from a body at a pose: height, m,
 * roll, pitch and yaw, rad. Return the largest distance of a foot from there before the last of
 * some steps, m. */
double cpg_pose(const cpg_body *b, const cpg_real *pose, cpg_real *angles, int steps)
{
    static const cpg_real axes[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    cpg_real worst = 0.0;
    for (int16_t leg = 0; leg < b->legs; leg++) {
        const cpg_real *foot = b->limbs[leg][7];
        cpg_real place[3] = {foot[0], foot[1], foot[2] - pose[0]}, far = 0.0;
        for (int16_t i = 2; i >= 0; i--) {
            turn_about(axes[i], -pose[1 + i], place);
        }
        for (int n = 0; n < steps; n++) {
            far = step_to(b, leg, place, angles);
        }
        worst = most(worst, far);
    }
    return worst;
}

/* Move the body towards its target, and the stand's angles with it. */
static void move_body(cpg *c, cpg_real dt)
{
    cpg_body *b = c->body;
    if (!(dt > 0.0) || !__atomic_load_n(&b->moving, __ATOMIC_ACQUIRE)) {
        return;
    }
    cpg_smoother *pose = &b->pose;
    approach(pose, 3, dt * b->pace);
    uint8_t there = 1;
    for (int16_t k = 0; k < 4; k++) {
        there = there && fabs(pose->now[k] - pose->target[k]) < POSE_TOLERANCE
                      && fabs(pose->rate[k]) < POSE_TOLERANCE;
    }
    for (int16_t joint = 0; joint < c->joints; joint++) {
        b->rate[joint] = -c->offset[joint] / dt;
    }
    cpg_pose(b, pose->now, c->offset, 2);
    for (int16_t joint = 0; joint < c->joints; joint++) {
        b->rate[joint] = there ? 0.0 : b->rate[joint] + c->offset[joint] / dt;
    }
    if (there) {
        __atomic_store_n(&b->moving, 0, __ATOMIC_RELEASE);
        for (int16_t k = 0; k < 4; k++) {
            /* A target may have come meanwhile. */
            if (fabs(pose->now[k] - pose->target[k]) >= POSE_TOLERANCE) {
                __atomic_store_n(&b->moving, 1, __ATOMIC_RELEASE);
            }
        }
    }
}

/* Add the rates of the stand's angles. */
static void carry(const cpg *c, cpg_real *rate)
{
    for (int16_t joint = 0; joint < c->joints; joint++) {
        rate[joint] += c->body->rate[joint];
    }
}
