"""Services of the back end `zeromq`: a node's servers, clients and surveyors."""
