using System;
using System.Collections.Generic;
using System.Globalization;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Requests to a master and its replies. Thread-safe.</summary>
    internal sealed class MasterCalls
    {
        private const int AskAgainMs = 500;
        private const int SendAgainMs = 20;
        private const int MaxCalls = 256;

        private readonly object _lock = new object();
        private readonly Dictionary<long, Call> _calls = new Dictionary<long, Call>();
        private readonly string _address;
        private readonly DealerSocket _socket;
        private long _lastNumber;
        private bool _isConnected;
        private bool _isClosed;

        public MasterCalls(string address, DealerSocket socket)
        {
            _address = address;
            _socket = socket;
        }

        public bool IsConnected
        {
            get
            {
                lock (_lock)
                {
                    return _isConnected;
                }
            }
            set
            {
                lock (_lock)
                {
                    _isConnected = value;
                    Monitor.PulseAll(_lock);
                }
            }
        }

        /// <summary>Send a request if connected; <paramref name="then"/> is called with its reply, in the socket's thread.</summary>
        public void Tell(string name, Dictionary<object, object> what, Action<Fields> then)
        {
            Call call = Begin(name, what, then, false);
            if (!_socket.Send(call.Body) || then == null)
            {
                lock (_lock)
                {
                    _calls.Remove(call.Number);
                }
            }
        }

        /// <summary>Send a request, repeat it until there is a reply, and wait; <paramref name="then"/> is called before this returns.</summary>
        /// <exception cref="MasterUnreachableException">No reply arrived before the timeout (-1 for none).</exception>
        /// <exception cref="RequestRefusedException">The master rejected the request.</exception>
        public void Ask(string name, Dictionary<object, object> what, int timeoutMs, Action<Fields> then)
        {
            Call call = Begin(name, what, then, true);
            var deadline = new Deadline(timeoutMs);
            var sendAgain = new Deadline(0);
            lock (_lock)
            {
                while (!call.IsAnswered)
                {
                    if (_isClosed || deadline.IsOver)
                    {
                        _calls.Remove(call.Number);
                        throw new MasterUnreachableException(_address, Unreached(timeoutMs));
                    }
                    if (_isConnected && sendAgain.IsOver)
                    {
                        // A request may be lost if its master exits.
                        sendAgain = new Deadline(_socket.Send(call.Body) ? AskAgainMs : SendAgainMs);
                    }
                    Monitor.Wait(_lock, SendAgainMs);
                }
            }
            if (call.Refusal != null)
            {
                throw new RequestRefusedException(call.Refusal);
            }
        }

        /// <summary>Handle a reply.</summary>
        public void Complete(long number, string name, Fields what)
        {
            Call call;
            lock (_lock)
            {
                if (!_calls.TryGetValue(number, out call))
                {
                    return; // second reply to a repeated request
                }
                _calls.Remove(number);
            }
            try
            {
                if (name == "refused")
                {
                    call.Refusal = what.Text("reason", "");
                }
                else if (call.Then != null)
                {
                    call.Then(what);
                }
            }
            finally
            {
                lock (_lock)
                {
                    call.IsAnswered = true;
                    Monitor.PulseAll(_lock);
                }
            }
        }

        /// <summary>Close; waiting calls throw <see cref="MasterUnreachableException"/>.</summary>
        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                Monitor.PulseAll(_lock);
            }
        }

        private string Unreached(int timeoutMs)
        {
            string seconds = (Math.Max(0, timeoutMs) / 1000.0).ToString("0.#", CultureInfo.InvariantCulture);
            if (_isConnected)
            {
                return "The program at " + _address + " did not answer within " + seconds + " s. It isn't a master, or it hangs. "
                    + "Restart it, or set NEP_MASTER to the address of a master.";
            }
            string missed = "No master replied at " + _address + " within " + seconds + " s";
            return _socket.Problem == null
                ? missed + ". Start one with 'nep master', or set NEP_MASTER to its address."
                : missed + ": the program at this address isn't a master (" + _socket.Problem + "). Stop it, or set NEP_MASTER to the address of a master.";
        }

        private Call Begin(string name, Dictionary<object, object> what, Action<Fields> then, bool isWaited)
        {
            var call = new Call { Then = then, IsWaited = isWaited };
            lock (_lock)
            {
                call.Number = ++_lastNumber;
                Call old;
                if (_calls.TryGetValue(call.Number - MaxCalls, out old) && !old.IsWaited)
                {
                    _calls.Remove(old.Number); // its master has exited
                }
                _calls[call.Number] = call;
            }
            call.Body = MessagePackWriter.Write(new Dictionary<object, object> { { "do", name }, { "call", call.Number }, { "what", what } });
            return call;
        }

        private sealed class Call
        {
            public long Number;
            public byte[] Body;
            public Action<Fields> Then;
            public string Refusal;
            public bool IsWaited;
            public bool IsAnswered;
        }
    }
}
