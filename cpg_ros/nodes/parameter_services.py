"""Parameter services that answer malformed requests instead of dying of them."""

from collections.abc import Sequence

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService


class StrictParameterService(ParameterService):
    """rclpy's service, but values of no known type and unknown names are refused with a reason.

    rclpy 7.1 lets the exception of the first out of the executor, so that one request ends the
    node, and answers the second without the name.
    """

    def _set_parameters_callback(
            self, request: SetParameters.Request, response: SetParameters.Response
            ) -> SetParameters.Response:
        response.results = [self._judged([parameter]) for parameter in request.parameters]
        return response

    def _set_parameters_atomically_callback(
            self, request: SetParametersAtomically.Request,
            response: SetParametersAtomically.Response) -> SetParametersAtomically.Response:
        response.result = self._judged(request.parameters)
        return response

    def _judged(self, messages: Sequence[ParameterMessage]) -> SetParametersResult:
        parameters = []
        for message in messages:
            try:
                parameters.append(Parameter.from_parameter_msg(message))
            except (ValueError, TypeError, RuntimeError) as error:
                return SetParametersResult(successful=False,
                                           reason=f'{message.name}: {error}')
        node = self._get_node()
        for parameter in parameters:
            if not node.has_parameter(parameter.name):
                return SetParametersResult(
                    successful=False, reason=f"there is no parameter '{parameter.name}'")
        return node.set_parameters_atomically(parameters)
