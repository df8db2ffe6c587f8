"""Parameter services that answer malformed requests instead of dying of them."""

from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService


class StrictParameterService(ParameterService):
    """rclpy's service, but a value of no known type is refused with a reason.

    rclpy 7.1 lets the exception out of the executor: one such request would end the node.
    """

    def _set_parameters_callback(self, request, response):
        response.results = [self._judged([parameter]) for parameter in request.parameters]
        return response

    def _set_parameters_atomically_callback(self, request, response):
        response.result = self._judged(request.parameters)
        return response

    def _judged(self, messages) -> SetParametersResult:
        parameters = []
        for message in messages:
            try:
                parameters.append(Parameter.from_parameter_msg(message))
            except (ValueError, TypeError, RuntimeError) as error:
                return SetParametersResult(successful=False,
                                           reason=f'{message.name}: {error}')
        try:
            return self._get_node().set_parameters_atomically(parameters)
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=str(error))
