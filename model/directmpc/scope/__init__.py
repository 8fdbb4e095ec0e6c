"""The scope: what a drive measured, decided and switched, on a page in a browser.

`directmpc scope` serves it for a board, for the virtual board and for a file; `show` for a result
of `simulate`. docs/scope.md is its manual.
"""

from directmpc.scope.command import show

__all__ = ["show"]
