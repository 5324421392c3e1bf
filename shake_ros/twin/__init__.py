"""The found model beside the running table: parameters followed with intervals, changes noticed and named."""
