"""Published quantities of the papers, each beside what our own numerics give for it.

Imports ``inversion``, ``gaits``, ``dynamics`` and what is below; knows nothing of ROS.
"""

__all__ = ['buono_blocks', 'buono_gaits', 'buono_golubitsky', 'buono_groups', 'buono_hopf',
           'buono_tables', 'catalogue', 'cell_constants', 'commentary', 'errata', 'figures',
           'liu_zhang', 'oscillators', 'published_normal_form', 'rashidi', 'reproduction',
           'rhythm', 'row', 'theorem_4_2']
