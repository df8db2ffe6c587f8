"""Speed: a robot that is too slow takes longer strides."""

from cpg_ros.integration.jit import jit


@jit
def longer(missing, way, gains):
    """Return what to add to strides; missing speed in m/s, its integral in m."""
    return min(max(gains.speed_share * missing + gains.speed_rate * way, -gains.speed_most),
               gains.speed_most)


@jit
def gather(way, missing, gains, dt):
    """Return the integral of the missing speed, m, no larger than the law can use."""
    most = gains.speed_most / max(gains.speed_rate, 1e-9)
    return min(max(way + dt * missing, -most), most)
