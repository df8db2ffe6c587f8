"""The networks by name, and the presets of each."""

from cpg_ros.networks import biped, delayed, quadruped
from cpg_ros.networks.network import Network, Preset

NETWORKS: dict[str, type[Network]] = {
    network.name: network for network in (delayed.Delayed, quadruped.Quadruped, biped.Biped)}

#: Network -> name -> preset; a gait's own name comes first and is the usual one.
PRESETS: dict[str, dict[str, Preset]] = {
    'delayed': delayed.PRESETS, 'quadruped': quadruped.PRESETS, 'biped': biped.PRESETS}

#: Network -> the gait it usually starts with.
USUAL = {'delayed': 'trot', 'quadruped': 'trot', 'biped': 'walk'}
