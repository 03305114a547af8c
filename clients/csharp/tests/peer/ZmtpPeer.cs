using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using System.Threading;
using Nep.Zmtp;

/// <summary>Drives the three sockets by lines on stdin, for tests against libzmq. See tests/clients/test_csharp_zmtp.py.</summary>
internal static class ZmtpPeer
{
    private static readonly object Output = new object();

    private static int Main(string[] arguments)
    {
        var limits = new ZmtpLimits();
        foreach (string each in arguments)
        {
            if (each.StartsWith("queue=", StringComparison.Ordinal))
            {
                limits.MaxQueuedBytes = long.Parse(each.Substring(6), CultureInfo.InvariantCulture);
                limits.AlwaysQueueBelowBytes = 0;
            }
            if (each.StartsWith("handshake_ms=", StringComparison.Ordinal))
            {
                limits.HandshakeTimeoutMs = int.Parse(each.Substring(13), CultureInfo.InvariantCulture);
            }
            if (each.StartsWith("reconnect_ms=", StringComparison.Ordinal))
            {
                limits.MinReconnectMs = limits.MaxReconnectMs = int.Parse(each.Substring(13), CultureInfo.InvariantCulture);
            }
            if (each.StartsWith("heartbeat_ms=", StringComparison.Ordinal))
            {
                limits.HeartbeatMs = int.Parse(each.Substring(13), CultureInfo.InvariantCulture);
                limits.HeartbeatTimeoutMs = 5 * limits.HeartbeatMs;
                limits.IsHeartbeatLocal = true;
            }
        }
        if (arguments[0] == "dealer")
        {
            return new DealerPeer(arguments[1], limits).Run();
        }
        return arguments[0] == "sub" ? new SubPeer(limits).Run() : new XPubPeerProgram(arguments[1], limits).Run();
    }

    internal static void Say(string line)
    {
        lock (Output)
        {
            Console.Out.WriteLine(line);
            Console.Out.Flush();
        }
    }

    internal static byte[] FromHex(string text)
    {
        var bytes = new byte[text.Length / 2];
        for (int i = 0; i < bytes.Length; i++)
        {
            bytes[i] = byte.Parse(text.Substring(2 * i, 2), NumberStyles.HexNumber, CultureInfo.InvariantCulture);
        }
        return bytes;
    }

    internal static string ToHex(byte[] bytes)
    {
        var text = new StringBuilder();
        foreach (byte each in bytes)
        {
            text.Append(each.ToString("x2", CultureInfo.InvariantCulture));
        }
        return text.ToString();
    }

    /// <summary>Formats short parts as hexadecimal digits, long ones as size and checksum.</summary>
    internal static string Show(byte[][] parts)
    {
        var shown = new List<string>();
        foreach (byte[] part in parts)
        {
            if (part.Length <= 64)
            {
                shown.Add(ToHex(part));
                continue;
            }
            long sum = 0;
            foreach (byte each in part)
            {
                sum += each;
            }
            shown.Add(part.Length + ":" + sum);
        }
        return string.Join(" ", shown.ToArray());
    }

    internal static string Show(CloseCounter counter)
    {
        var shown = new List<string>();
        foreach (KeyValuePair<string, long> each in counter.Snapshot())
        {
            shown.Add(each.Key + "=" + each.Value);
        }
        return "refused " + string.Join(" ", shown.ToArray());
    }

    private sealed class DealerPeer : IDealerOwner
    {
        private readonly DealerSocket _socket;

        public DealerPeer(string endpoint, ZmtpLimits limits)
        {
            ZmtpEndpoint parsed;
            ZmtpEndpoint.TryParse(endpoint, out parsed);
            _socket = new DealerSocket(parsed, this, limits, NullMechanism.Create);
        }

        public int Run()
        {
            _socket.Start();
            string line;
            while ((line = Console.In.ReadLine()) != null)
            {
                if (line == "refused")
                {
                    Say(Show(_socket.Refused));
                }
                else if (line == "problem")
                {
                    Say("problem " + _socket.Problem);
                }
            }
            _socket.Close(1000);
            return 0;
        }

        public void Connected()
        {
            Say("connected");
        }

        public void Received(byte[][] parts)
        {
            _socket.Send(parts);
        }

        public void Disconnected(string reason)
        {
            Say("disconnected");
        }
    }

    private sealed class SubPeer : ISubOwner
    {
        private readonly SubSocket _socket;
        private SubConnection _connection;
        private long _count;
        private bool _isQuiet;

        public SubPeer(ZmtpLimits limits)
        {
            _socket = new SubSocket(this, limits, NullMechanism.Create);
        }

        public int Run()
        {
            string line;
            while ((line = Console.In.ReadLine()) != null)
            {
                string[] words = line.Split(' ');
                switch (words[0])
                {
                    case "connect":
                        _connection = _socket.Connect(words[1], null);
                        break;
                    case "problem":
                        Say("problem " + _connection.Problem);
                        break;
                    case "subscribe":
                        _socket.Subscribe(FromHex(words[1]));
                        break;
                    case "unsubscribe":
                        _socket.Unsubscribe(FromHex(words[1]));
                        break;
                    case "quiet":
                        _isQuiet = true;
                        break;
                    case "count":
                        Say("count " + Interlocked.Read(ref _count));
                        break;
                    case "refused":
                        Say(Show(_socket.Refused));
                        break;
                }
            }
            _socket.Dispose();
            return 0;
        }

        public void Received(SubConnection from, byte[][] parts)
        {
            Interlocked.Increment(ref _count);
            if (!_isQuiet)
            {
                Say("message " + Show(parts));
            }
        }

        public void Disconnected(SubConnection from, string reason)
        {
        }
    }

    private sealed class XPubPeerProgram : IXPubOwner
    {
        private readonly XPubSocket _socket;

        public XPubPeerProgram(string host, ZmtpLimits limits)
        {
            _socket = new XPubSocket(this, limits, NullMechanism.Create);
            Say("bound " + _socket.Acceptor.Bind(host, port => true));
        }

        public int Run()
        {
            string line;
            while ((line = Console.In.ReadLine()) != null)
            {
                string[] words = line.Split(' ');
                if (words[0] == "send")
                {
                    var parts = new byte[words.Length - 1][];
                    for (int i = 1; i < words.Length; i++)
                    {
                        parts[i - 1] = FromHex(words[i]);
                    }
                    _socket.Send(parts[0], EncodedMessage.Message(parts));
                }
                else if (words[0] == "burst")
                {
                    Burst(FromHex(words[1]), int.Parse(words[2]), int.Parse(words[3]));
                }
                else if (words[0] == "refused")
                {
                    Say(Show(_socket.Refused));
                }
            }
            _socket.Close(2000);
            return 0;
        }

        public void FilterChanged(XPubPeer peer, byte[] filter, bool isSubscribed)
        {
            Say((isSubscribed ? "+" : "-") + ToHex(filter));
        }

        public void Left(XPubPeer peer)
        {
            Say("left");
        }

        public void Rejected(string reason)
        {
            Say("rejected");
        }

        private void Burst(byte[] topic, int count, int size)
        {
            var body = new byte[size];
            for (int i = 0; i < size; i++)
            {
                body[i] = (byte)(i * 7);
            }
            int taken = 0;
            for (int i = 0; i < count; i++)
            {
                taken += _socket.Send(topic, EncodedMessage.Message(topic, BitConverter.GetBytes(i), body));
            }
            Say("sent " + taken);
        }
    }
}
